"""Joints that cannot be straightened, entered at a live station over the API."""

from typing import Any

import pytest
from starlette.testclient import TestClient

from handscope.app.live.measured_pose import GONIOMETER_SD
from tests.app.api.live.test_other_hand import first, station_of  # noqa: F401  a fixture


def entered(client: TestClient, name: str, angles: dict[str, Any]) -> Any:
    return client.put(f"/api/stations/{name}/stiff-joints", json={"angles": angles})


@pytest.fixture
def name(client: TestClient, first: dict[str, Any]) -> Any:  # noqa: F811
    yield first["station"]
    client.delete(f"/api/stations/{first['station']}")


def test_what_was_entered_is_in_the_snapshot_and_in_the_poses_event_until_it_is_removed(
    client: TestClient, name: str
) -> None:
    angles = {"index_pip": 30.0, "thumb_ip": -12.0}
    answer = entered(client, name, angles)
    assert answer.status_code == 200, answer.text
    snapshot = client.get(f"/api/stations/{name}").json()
    assert snapshot["stiff_joints"] == answer.json()["stiff_joints"]
    assert snapshot["stiff_joints"] == {"angles": angles, "pending": True, "asked": []}
    columns = station_of(client, name).measured_pose.columns()
    assert columns == {
        "index_pip_flexion_deg": 30.0,
        "index_pip_flexion_sd_deg": GONIOMETER_SD,
        "thumb_ip_flexion_deg": -12.0,
        "thumb_ip_flexion_sd_deg": GONIOMETER_SD,
    }
    left = entered(client, name, {}).json()["stiff_joints"]
    assert left == {"angles": {}, "pending": False, "asked": []}
    assert station_of(client, name).measured_pose.columns() == {}


@pytest.mark.parametrize(
    ("angles", "code", "said"),
    [
        ({"index_pip": 160.0}, "live.stiff_joint_angle", "Index PIP cannot be at 160 deg"),
        ({"index_pip": -60.0}, "live.stiff_joint_angle", "hyperextension with a minus"),
        ({"thumb_cmc": 30.0}, "live.stiff_joint_unknown", "no joint 'Thumb"),
        ({"wrist": 30.0}, "live.stiff_joint_unknown", "joints are Thumb MCP, Thumb IP"),
        ({"index_pip": None}, "server.not_understood", "number"),
    ],
)
def test_what_no_joint_can_be_is_refused_and_nothing_changes(
    client: TestClient, name: str, angles: dict[str, Any], code: str, said: str
) -> None:
    entered(client, name, {"ring_dip": 20.0})
    answer = entered(client, name, {"little_pip": 10.0, **angles})
    assert (answer.status_code, answer.json()["code"]) == (422, code)
    assert said in answer.json()["error"]
    kept = client.get(f"/api/stations/{name}").json()["stiff_joints"]["angles"]
    assert kept == {"ring_dip": 20.0}
