"""Addresses of sources that do not speak the wire protocol: SCHEME://WHAT[?map=FILE.json].

A new source is a file beside this one and a line in SOURCES; its module is loaded when somebody opens it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl, unquote

from handscope.estimators.errors import InputError

if TYPE_CHECKING:  # the recording process begins without numpy
    from handscope.app.devices.sources.translated import TranslatedPort
    from handscope.sessions.table_import.column_map import ColumnMap

ROOM = "handscope.app.devices.sources"
SOURCES: Mapping[str, tuple[str, str]] = {  # scheme: module, how its addresses look
    "slimevr": (f"{ROOM}.slimevr.opening", "slimevr://[HOST:]PORT[?map=FILE.json]"),
    "lsl": (f"{ROOM}.lsl", "lsl://NAME?map=FILE.json"),
    "ximu3": (f"{ROOM}.ximu3", "ximu3://tcp/HOST:PORT, ximu3://serial/PORT (?map=FILE.json)"),
}


@dataclass(frozen=True)
class SourceAddress:
    """An address, taken apart."""

    url: str
    scheme: str
    what: str  # behind the scheme
    map_file: Path | None

    def columns(self) -> "ColumnMap | None":
        """The map that the address names; InputError where it is none."""
        from handscope.sessions.table_import.column_map import read_map

        return None if self.map_file is None else read_map(self.map_file, of_stream=True)


def is_source(url: str) -> bool:
    """Whether an address is that of a source here."""
    return url.partition("://")[0] in SOURCES


def parse_source(url: str) -> SourceAddress:
    """An address taken apart; InputError where it is none of a source."""
    scheme, _, rest = url.partition("://")
    what, _, query = rest.partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    if scheme not in SOURCES or not what or "#" in rest or set(options) - {"map"}:
        form = SOURCES[scheme][1] if scheme in SOURCES else "SCHEME://..."
        raise InputError("device.source_address_form", url=url, form=form)
    file = options.get("map")
    return SourceAddress(url, scheme, unquote(what), Path(file) if file else None)


def open_source(url: str) -> "TranslatedPort":
    """Open a source as a port; InputError says why it cannot be opened."""
    from handscope.app.devices.sources.translated import TranslatedPort

    address = parse_source(url)
    return TranslatedPort(import_module(SOURCES[address.scheme][0]).open_source(address))
