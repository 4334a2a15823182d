"""The outlets that a session may ask for: one line each in OUTLETS; the administrator allows them by address."""

from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase

from handscope.app.live.outputs import lsl_outlet, osc_sender
from handscope.app.live.outputs.outlets import Outlet
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand

Clock = Callable[[], float | None]  # the recording's time of this moment, s
MakeOutlet = Callable[[str, Hand, str, str, Clock], Outlet]
MOST = 4  # of a session
OUTLETS: Mapping[str, MakeOutlet] = {
    "lsl": lambda _, hand, source, method, now: lsl_outlet.LslOutlet(hand, source, method, now),
    "osc": lambda url, hand, *_: osc_sender.OscSender(hand, url),
}


def open_outlets(
    addresses: Sequence[str], hand: Hand, source: str, method: str, now: Clock
) -> list[Outlet]:
    """The outlets asked for: `lsl`, `osc://HOST:PORT`; `source` makes their names those of one session.

    InputError for an unknown address and for a package that is not installed.
    """
    if len(addresses) > MOST:
        raise InputError("live.too_many_outlets", most=MOST)
    opened: list[Outlet] = []
    try:
        for address in dict.fromkeys(addresses):
            opened.append(OUTLETS[kind_of(address)](address, hand, source, method, now))
    except BaseException:
        for outlet in opened:
            outlet.close()
        raise
    return opened


def require_allowed(addresses: Sequence[str], patterns: Sequence[str]) -> None:
    """InputError for an address that no pattern of the administrator allows, before any name is looked up."""
    for address in addresses:
        kind_of(address)
        if not any(fnmatchcase(address, pattern) for pattern in patterns):
            raise InputError("live.outlet_not_allowed", address=address)


def kind_of(address: str) -> str:
    """A name of OUTLETS; InputError where the address is none of them."""
    kind = address.partition("://")[0]
    if kind not in OUTLETS or (kind == "lsl" and address != "lsl"):
        raise InputError("live.outlet_unknown", address=address)
    if kind == "osc":
        osc_sender.address_of(address)
    return kind
