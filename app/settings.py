"""What a server is started with; `create_app` builds everything from it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from handscope.app.auth.oidc import SignOn


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How a server is run: folders, addresses, limits."""

    data: Path
    host: str = "127.0.0.1"
    port: int = 8420
    database_url: str | None = None
    # URL of an object storage that closed files are moved to; None leaves them where they are
    recordings: str | None = None
    # address of this server among several that share database and object storage; None: no sharing
    # is asked for
    shared_at: str | None = None
    # address of the administrator's Dask cluster that makes reports, exports and self-calibrations;
    # None: this machine does
    scheduler: str | None = None
    # of files that are in the object storage, kept on this disk as well
    cache_bytes: int = 20 * 10**9
    hosts: tuple[str, ...] = ()  # names under which the server may be addressed besides its own
    # ports of virtual gloves that this program put up, and what they are called
    demo_ports: Mapping[str, str] = field(default_factory=dict)
    # shell patterns of network addresses that a session may open as a glove's port
    allowed_ports: tuple[str, ...] = ()
    # shell patterns of outlets (lsl, osc://HOST:PORT) that a session may send to
    allowed_outlets: tuple[str, ...] = ()
    # addresses of reverse proxies whose X-Forwarded-For and X-Forwarded-Proto are trusted
    proxies: tuple[str, ...] = ()
    metrics: tuple[str, int] | None = None  # where figures for a monitoring system are served
    sign_on: SignOn | None = None  # an organisation's login
    second_factor: tuple[str, ...] = ()  # roles that need a second factor
    # s without a request or an open live view after which a login ends
    idle_logout: float = 4 * 3600.0
    longest_login: float = 24 * 3600.0  # s after which every login ends
    largest_upload: int = 512 * 2**20  # bytes
