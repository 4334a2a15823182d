"""x-IMU3s: what their library gives of bytes that a device sends over TCP, by labels of a map."""

import json
import socket
import threading
import time
from contextlib import closing
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handscope.app.devices.sources import ximu3
from handscope.app.devices.sources.addresses import parse_source
from handscope.app.devices.sources.source import Arrived, Battery, Measured
from handscope.estimators.data.samples import ACC, GYR, MAG, ORIENTATION
from handscope.estimators.errors import InputError
from handscope.sessions.table_import.column_map import parse_map

MAP: dict[str, Any] = {
    "hand": "left",
    "sensors": {
        "hand": {
            "gyr": {"columns": ["gx", "gy", "gz"], "unit": "deg/s"},
            "acc": {"columns": ["ax", "ay", "az"], "unit": "g"},
            "mag": {"columns": ["mx", "my", "mz"], "unit": "uT"},
            "orientation": {"columns": ["qw", "qx", "qy", "qz"], "unit": "1"},
        }
    },
}


class _Connection:
    """What the library's connection does: it calls back."""

    def __init__(self) -> None:
        self.call: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        return lambda callback: self.call.update({name: callback})

    def open(self) -> None:
        pass

    def close(self) -> None:
        pass


def _devices(names: list[str], **changes: Any) -> ximu3.Devices:
    return ximu3.Devices(names, parse_map(MAP | changes, "map.json", True))


def test_messages_become_si_at_the_time_of_the_device() -> None:
    devices, connection = _devices(["a:1"]), _Connection()
    devices.connect("a:1", connection)
    for k in range(3):
        fields = dict.fromkeys(("gyroscope_y", "gyroscope_z", "accelerometer_x"), 0.0)
        message = SimpleNamespace(
            timestamp=1_000_000 + 10_000 * k,
            gyroscope_x=180.0,
            accelerometer_y=0.0,
            accelerometer_z=1.0,
            **fields,
        )
        connection.call["add_inertial_callback"](message)
    connection.call["add_magnetometer_callback"](SimpleNamespace(timestamp=1, x=1.0, y=2.0, z=3.0))
    connection.call["add_quaternion_callback"](
        SimpleNamespace(timestamp=1, w=1.0, x=0.0, y=0.0, z=0.0)
    )
    connection.call["add_battery_callback"](SimpleNamespace(timestamp=1, percentage=80.2))
    found = devices.receive(0.1)
    quantities = [m.quantities for m in found if isinstance(m, Measured)]
    assert quantities == [(GYR, ACC)] * 3 + [(MAG,), (ORIENTATION,)]
    first, third = found[0], found[2]
    assert isinstance(first, Measured) and isinstance(third, Measured)
    np.testing.assert_allclose(first.values[0, 0], [np.pi, 0, 0, 0, 0, 9.80665])
    assert int(third.t[0]) > int(first.t[0])
    assert [b.percent for b in found if isinstance(b, Battery)] == [80]


def test_messages_are_kept_as_they_came() -> None:
    """Also those that nothing is made of, in the device's units."""
    devices, connection = _devices(["a:1"]), _Connection()
    devices.connect("a:1", connection)
    q = {"w": 1.0, "x": 0.1, "y": 0.2, "z": 0.3}
    connection.call["add_quaternion_callback"](SimpleNamespace(timestamp=7, **q))
    connection.call["add_temperature_callback"](SimpleNamespace(timestamp=8, temperature=25.3))
    connection.call["add_notification_callback"](SimpleNamespace(timestamp=9, bytes=b"N\xff"))
    assert [type(a) for a in devices.receive(0.1)] == [Measured]
    (kept,) = devices.take_originals()
    rows = [json.loads(line) for line in kept.body.splitlines()]
    assert [(row[0], row[1], row[3]) for row in rows] == [
        ("a:1", "quaternion", {"timestamp": 7, **q}),
        ("a:1", "temperature", {"timestamp": 8, "temperature": 25.3}),
        ("a:1", "notification", {"timestamp": 9, "bytes": "4eff"}),
    ]
    assert list(devices.take_originals()) == []


def test_labels_of_no_device_are_named() -> None:
    with pytest.raises(InputError, match="are no channels of one x-IMU3"):
        _devices(["a:1", "b:2"])


@pytest.mark.parametrize("url", ["ximu3://udp/x", "ximu3://tcp/x", "ximu3://tcp/"])
def test_an_address_of_no_connection_is_refused(url: str, tmp_path: Any) -> None:
    pytest.importorskip("ximu3")
    (tmp_path / "m.json").write_text(json.dumps(MAP))
    with pytest.raises(InputError, match="x-IMU3"):
        ximu3.open_source(parse_source(f"{url}?map={tmp_path / 'm.json'}"))


def test_the_library_reads_a_device_over_tcp() -> None:
    library = pytest.importorskip("ximu3")
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        name = f"127.0.0.1:{server.getsockname()[1]}"

        def send() -> None:
            with closing(server.accept()[0]) as client:
                for k in range(50):
                    client.sendall(f"I,{10_000 * k},90.0,0.0,0.0,0.0,0.0,1.0\r\n".encode())
                time.sleep(0.5)  # until all was read: the library closes with the connection

        thread = threading.Thread(target=send, daemon=True)
        thread.start()
        devices = _devices([name])
        config = library.TcpConnectionConfig(*name.split(":")[:1], int(name.split(":")[1]))
        with closing(devices):
            devices.connect(name, library.Connection(config))
            found: list[Arrived] = []
            until = time.monotonic() + 5.0
            while len(found) < 50 and time.monotonic() < until:
                found += devices.receive(0.1)
        thread.join()
    values = np.concatenate([m.values for m in found if isinstance(m, Measured)])
    assert len(values) == 50
    np.testing.assert_allclose(values[:, 0, 0], np.pi / 2, rtol=1e-6)
