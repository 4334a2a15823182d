"""Which strip of the glove at a port has a fingertip's force sensor, and whether a calibration that is kept here can be applied to it."""

from handscope.app.devices.strip_flash import Talk
from handscope.estimators.data.samples import FORCE
from handscope.estimators.errors import InputError
from handscope.estimators.force.sensor import ForceCalibration
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.assembly import Assembler


def strip_of(path: str, point: str, found: ForceCalibration) -> int:
    """Stop the glove and give the strip's number; InputError where none has the sensor, or it is another kind of sensor."""
    with Talk.at(path) as talk:
        talk.ask(wire.Stop())
        talk.ask(wire.Identify())
        return fitting(talk.assembler, point, found)


def fitting(assembler: Assembler, point: str, found: ForceCalibration) -> int:
    """The number of the strip with this sensor, of a glove that has said what it has; InputError as above."""
    strip = next((s for s in assembler.strips.values() if point in s.points), None)
    if strip is None:
        raise InputError("device.calibrated_strip_missing", point=point)
    if any((strip.slot, k) in assembler.forces for k in range(len(strip.points))):
        raise InputError("device.strip_calibrated_itself", point=point)
    sent = [
        i.quantities
        for i in assembler.infos.values()
        if i.slot == strip.slot and FORCE in i.quantities
    ]
    axes = 3 * len(sent[0]) if sent else 0
    rows, channels = found.matrix.shape
    if rows != channels or channels > axes:
        raise InputError("device.channel_count_differs", point=point, channels=channels, axes=axes)
    return strip.strip_id
