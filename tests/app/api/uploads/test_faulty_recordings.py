"""A recording with a fault of a sensor, from the upload to the answer: named with what to do, and no figure on it is good."""

import pytest
from fastapi.testclient import TestClient

from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from tests.app.api.test_recordings import changed, finished, upload
from tests.simulated import pose_and_wiggle


@pytest.fixture(scope="module")
def intact() -> bytes:
    made = pose_and_wiggle("left", SensorErrors())
    recording = LoadedRecording(
        made.hand, made.geometry, {}, made.samples, made.events, source={"device": "simulated"}
    )
    return writer.pack(writer.tree(recording, "01", "wiggle"))


def exchange(channels: bytes) -> bytes:
    """Two sensors of a finger under each other's names."""
    a, b, between = b"ring_middle", b"ring_distal", b"ring_between"
    return channels.replace(a, between).replace(b, a).replace(between, b)


def test_exchanged_sensors_are_named_and_no_figure_on_them_is_good(
    client: TestClient, patient: int, intact: bytes
) -> None:
    wrong = changed(intact, "imu_channels.tsv", exchange)
    result = finished(client, upload(client, patient, wrong).json()["result"])
    assert result["state"] == "done", result["error"]
    (named,) = [w for w in result["warnings"] if "ring middle and ring distal" in w]
    assert "exchanged" in named and "record again" in named
    trust = result["readings"]["trust"]
    assert trust["answer"] in ("mostly", "no") and trust["todo"]
    grades = {f["name"]: f["grade"] for f in result["readings"]["figures"]}
    on_them = {name for name in grades if name.startswith(("ring_pip", "ring_dip"))}
    assert on_them and not {grades[name] for name in on_them} & {"good"}
    assert "good" in {grade for name, grade in grades.items() if name.startswith("index_pip")}


def test_the_same_recording_without_the_fault_names_no_sensor(
    client: TestClient, patient: int, intact: bytes
) -> None:
    result = finished(client, upload(client, patient, intact).json()["result"])
    assert not any("ring middle" in w for w in result["warnings"])
