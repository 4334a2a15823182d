"""slimevr://[HOST:]PORT: where SlimeVR trackers are listened for."""

from handscope.app.devices.sources.addresses import SourceAddress
from handscope.app.devices.sources.slimevr.listener import Listener
from handscope.estimators.errors import InputError

EVERYWHERE = "0.0.0.0"  # all networks of this machine: the trackers search it by broadcast


def open_source(address: SourceAddress) -> Listener:
    """Listen; InputError where the port is none or taken."""
    host, _, number = address.what.rpartition(":")
    if not number.isascii() or not number.isdigit() or not 0 < int(number) < 65536:
        raise InputError("device.udp_port_missing", url=address.url)
    return Listener(host or EVERYWHERE, int(number), address.columns())
