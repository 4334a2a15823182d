"""A server of pages, API and 3-D scene, as the arguments of `handscope serve` (commands/serve.py) have it, until it is stopped."""

import argparse
import gc
import importlib.util
import os
import signal
import socket
import sys
import webbrowser
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FrameType

import uvicorn

from handscope.app.auth.oidc import SignOn
from handscope.app.auth.request_limits import BoundedProtocol
from handscope.app.auth.sign_on_scope import SCOPE
from handscope.app.commands.words import program, say
from handscope.app.options import parse
from handscope.app.private_log import begin_logging
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.app.workers import translation
from handscope.app.workers.memory_pools import limit_memory_pools
from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe
from handscope.sessions.clinic.second_factors import MISSING
from handscope.sessions.db.roles import ROLES
from handscope.sessions.login.logins import TOKEN_LIFE, new_token
from handscope.sessions.store.folder_privacy import keep_private
from handscope.sessions.store.shared_servers import find_identity

ANYWHERE, LOOPBACK = ("0.0.0.0", "::"), ("127.0.0.1", "::1", "localhost")
LARGEST_MESSAGE = 2**20  # bytes of a web socket message, before anybody looks at it
SWITCH = 5e-4  # s that a thread which has something to do waits for another: Python's 5 ms add up over a pose's way to its viewers


def serve(
    arguments: argparse.Namespace,
    demo_ports: Mapping[str, str],
    browser: bool,
    printed: bool,
    on_ready: Callable[[], None] = lambda: None,
) -> None:
    """Listen, print the address, `printed` with a one-time token, call `on_ready`, serve until stopped."""
    keep_private()
    limit_memory_pools()
    begin_logging()
    listener = _listen(arguments.host, arguments.port)
    base = _base(arguments.host, listener.getsockname()[1])
    try:
        app = create_app(_settings(arguments, demo_ports, base))
    except BaseException:
        listener.close()
        raise
    (arguments.data / "address").write_text(base + "\n")

    def announce() -> None:
        _announce(base, arguments.data, printed, browser)
        on_ready()

    config = uvicorn.Config(
        app,
        http=BoundedProtocol,
        log_config=None,  # uvicorn's lines go where ours go, without what people typed
        log_level="warning",
        access_log=False,
        ws="websockets-sansio",
        ws_max_size=LARGEST_MESSAGE,
        timeout_graceful_shutdown=5,
        server_header=False,
        proxy_headers=False,
    )
    sys.setswitchinterval(SWITCH)
    gc.collect()
    gc.freeze()  # what is loaded stays: going through all of it, as the collector does now and then, holds every thread up for 0.2 to 0.4 s
    server = _Server(config, announce)
    with translation.beside():
        server.run(sockets=[listener])
    if server.interrupted:
        raise KeyboardInterrupt


def _settings(arguments: argparse.Namespace, demo_ports: Mapping[str, str], base: str) -> Settings:
    """What the options say; `base` is where the server listens."""
    return Settings(
        data=arguments.data,
        host=arguments.host,
        port=arguments.port,
        database_url=arguments.database,
        recordings=arguments.recordings,
        shared_at=_shared_at(arguments, base),
        scheduler=_scheduler(arguments),
        cache_bytes=round(1e9 * arguments.cache),
        hosts=tuple(arguments.name),
        demo_ports=demo_ports,
        metrics=arguments.metrics,
        allowed_ports=tuple(arguments.allow_port),
        allowed_outlets=tuple(arguments.allow_outlet),
        proxies=tuple(arguments.proxy),
        sign_on=sign_on(arguments),
        second_factor=second_factor_roles(arguments),
        idle_logout=3600.0 * arguments.idle_logout,
        longest_login=3600.0 * arguments.longest_login,
    )


def _scheduler(arguments: argparse.Namespace) -> str | None:
    """The address of the cluster; InputError where the package that speaks to it is missing."""
    address: str | None = arguments.scheduler
    if address and importlib.util.find_spec("distributed") is None:
        raise InputError("cluster.no_package")
    return address


def _shared_at(arguments: argparse.Namespace, base: str) -> str | None:
    """Where browsers reach this one of several servers, by its first name, over TLS behind a proxy; "" where it has none and listens on this machine
    or on every address, None where it is one alone."""
    if not (arguments.shared or find_identity(arguments.data)):
        return None
    if not arguments.name:
        return "" if arguments.host in (*ANYWHERE, *LOOPBACK) else base
    name, port = arguments.name[0], base.rpartition(":")[2]
    return f"https://{name}" if arguments.proxy else f"http://{name}:{port}"


def _base(host: str, port: int) -> str:
    """The address at which this machine reaches the server."""
    name = "127.0.0.1" if host in ANYWHERE else f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}"


def sign_on(arguments: argparse.Namespace) -> SignOn | None:
    """What the options and the environment agree with a provider; None unless one is named."""
    if not arguments.oidc_issuer:
        return None
    mapping = arguments.oidc_role or os.environ.get("HANDSCOPE_OIDC_ROLES", "").split()
    roles = parse(mapping) or {role: role for role in ROLES}
    if unknown := set(roles.values()) - set(ROLES):
        raise InputError("command.oidc_role", unknown=sorted(unknown)[0], roles=", ".join(ROLES))
    if not arguments.oidc_issuer.startswith("https://"):
        raise InputError("command.oidc_issuer", oidc_issuer=arguments.oidc_issuer)
    if "openid" not in arguments.oidc_scope.split():
        raise InputError("command.oidc_scope", oidc_scope=arguments.oidc_scope, scope=SCOPE)
    secret = os.environ.get("HANDSCOPE_OIDC_SECRET", "")
    return SignOn(
        issuer=arguments.oidc_issuer,
        client=arguments.oidc_client,
        secret=secret,
        scope=arguments.oidc_scope,
        claim=arguments.oidc_claim,
        roles=roles,
    )


def second_factor_roles(arguments: argparse.Namespace) -> tuple[str, ...]:
    """Roles that need a second factor; InputError where one is none, or where nobody could make one."""
    roles = arguments.second_factor or os.environ.get("HANDSCOPE_SECOND_FACTOR", "").split()
    if unknown := set(roles) - set(ROLES):
        raise InputError(
            "command.second_factor_role",
            unknown=sorted(unknown)[0],
            roles=", ".join(ROLES),
        )
    if roles and importlib.util.find_spec("pyotp") is None:
        raise InputError(MISSING)
    return tuple(roles)


def _announce(base: str, data: Path, printed: bool, browser: bool) -> None:
    """Say where the server is. A code that lets a browser in is printed to a terminal alone, or where that is asked for: logs are kept."""
    address = f"{base}/login?token={new_token(data)}" if printed or browser else base
    minutes = TOKEN_LIFE.total_seconds() / 60
    once = (
        f"The address works once, for {minutes:.0f} minutes; print another"
        if printed
        else "Print an address that logs in"
    )
    say(
        f"Handscope is at  {address if printed else base}\n{once} with: {program()} login --data {data}\nResearch use; not a medical device. Stop with Ctrl-C."
    )
    if browser:
        webbrowser.open(address)


class _Server(uvicorn.Server):  # type: ignore[misc]  # mypy does not follow uvicorn
    """Says where it is once it answers, and once a signal ends it in good order; keeps that it was interrupted, which the event loop may swallow."""

    def __init__(self, config: uvicorn.Config, announce: Callable[[], None]) -> None:
        super().__init__(config)
        self._announce = announce
        self.interrupted = False

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self.interrupted = self.interrupted or sig == signal.SIGINT
        super().handle_exit(sig, frame)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._announce()


def _listen(host: str, port: int) -> socket.socket:
    if not 0 <= port <= 65535:
        raise InputError("command.port_outside", port=port)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio switches Nagle's delay off only where TCP is named
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    if sys.platform != "win32":
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as problem:
        listener.close()
        raise InputError(
            "command.cannot_listen", host=host, port=port, strerror=describe(problem)
        ) from None
    listener.listen(128)
    listener.set_inheritable(True)
    return listener
