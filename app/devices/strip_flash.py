"""Write calibrations into the flash of the strips at a port, and read them back: the glove must be stopped, nothing else may hold the port."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from handscope.app.devices.ports import open_port
from handscope.estimators.errors import InputError
from handscope.estimators.sensors.imu_calibration import ImuCalibration
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.framing import Encoder
from handscope.sessions.wire.strip_calibration import correction_of, message_of

ANSWER = 2.0  # s that a reply may take: a page of flash is erased in less than 0.1


def write(
    path: str, calibrations: Mapping[str, ImuCalibration], strip_ids: Mapping[str, str]
) -> list[str]:
    """Write by tracked point and verify; `strip_ids` are those in the recording. Gives the points written; InputError where one cannot be."""
    with Talk.at(path) as talk:
        talk.ask(wire.Stop())
        talk.ask(wire.Identify())
        places = _places(talk.assembler, calibrations, strip_ids)
        for point, (slot, sensor) in places.items():
            talk.ask(wire.ReadCalibration(slot))
            message = message_of(
                _over(talk.assembler.calibrations[slot, sensor], calibrations[point]), slot, sensor
            )
            talk.ask(wire.WriteCalibration(message))
            talk.ask(wire.ReadCalibration(slot))
            if talk.assembler.calibrations.get((slot, sensor)) != message:
                raise InputError("device.strip_did_not_keep", point=point)
        return list(places)


def _places(
    assembler: Assembler, calibrations: Mapping[str, ImuCalibration], strip_ids: Mapping[str, str]
) -> dict[str, tuple[int, int]]:
    """Slot and number of each point's sensor; refused before anything is written where one is missing or of another strip."""
    plugged = {
        point: (strip, k)
        for strip in assembler.strips.values()
        for k, point in enumerate(strip.points)
    }
    for point in calibrations:
        if point not in plugged:
            raise InputError("device.recorded_strip_missing", point=point)
        strip = plugged[point][0]
        if not strip.raw:
            raise InputError("device.strip_corrects_itself", point=point)
        if strip_ids.get(point, f"{strip.strip_id:x}") != f"{strip.strip_id:x}":
            raise InputError(
                "device.other_strip",
                point=point,
                strip_id=strip.strip_id,
                strip_ids=strip_ids[point],
            )
    return {point: (plugged[point][0].slot, plugged[point][1]) for point in calibrations}


def _over(stored: wire.StripCalibration, found: ImuCalibration) -> ImuCalibration:
    """What was found, and of quantities that were not calibrated what the strip has."""
    before = correction_of(stored)
    return ImuCalibration({**before.matrix, **found.matrix}, {**before.bias, **found.bias})


class Talk:
    """One question after the other over an open port."""

    @staticmethod
    @contextmanager
    def at(path: str) -> "Iterator[Talk]":
        """With the glove at a port that nothing else holds; it is closed at the end."""
        port = open_port(path)
        try:
            yield Talk(port)
        finally:
            port.close()

    def __init__(self, port: Any) -> None:
        self.assembler, self._port, self._encoder = Assembler(), port, Encoder()

    def ask(self, command: wire.Message) -> None:
        """Send and wait for the reply; InputError where it is not OK or does not come."""
        code, name = wire.encode(command)[0], type(command).__name__
        self.assembler.replies.clear()
        self._port.write(self._encoder.frame(command))
        end = time.monotonic() + ANSWER
        while time.monotonic() < end:
            self.assembler.feed(bytes(self._port.read(65536)), time.monotonic())
            for reply in self.assembler.replies:
                if reply.command == code:
                    if reply.code is not wire.ReplyCode.OK:
                        raise InputError(
                            "device.command_refused",
                            name=name,
                            value=reply.text or reply.code.name.lower().replace("_", " "),
                        )
                    return
        raise InputError("device.command_unanswered", name=name, answer=ANSWER)
