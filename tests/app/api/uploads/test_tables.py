"""A logger's table over the API: uploaded, mapped, checked, kept as a recording, and the map offered again."""

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

from handscope.app.settings import Settings
from handscope.app.workers import pending_tables
from handscope.estimators.data.samples import ACC, GYR
from handscope.sessions.db.tables import AuditLine
from tests.app.api.conftest import files_in
from tests.app.api.test_recordings import finished
from tests.simulated import DEG, pose_and_wiggle

GRAVITY = 9.80665


@pytest.fixture(scope="module")
def table() -> bytes:
    """A whole hand: decimal commas, degrees and g, shuffled columns with names that say nothing."""
    columns = {}
    block = max(pose_and_wiggle("left").samples.values(), key=lambda b: len(b.stream.sensors))
    columns["zeit"] = 1e3 * (block.t - block.t[0])
    for k, point in enumerate(block.stream.sensors):
        for letter, quantity, unit in (("a", GYR, DEG), ("b", ACC, GRAVITY)):
            values = block.of(quantity)[:, k] / unit
            columns |= {f"{letter}_{point[::-1]}_{c}": v for c, v in zip("uvw", values.T)}
    names = list(np.random.default_rng(2).permutation(list(columns)))
    rows = np.column_stack([columns[n] for n in names])
    lines = [";".join(f"{v:.6f}" for v in row).replace(".", ",") for row in rows]
    return "\n".join([";".join(names), *lines]).encode()


def sent(client: TestClient, patient: int, data: bytes, name: str = "log.csv") -> Any:
    return client.post(f"/api/patients/{patient}/tables", files={"file": (name, io.BytesIO(data))})


def mapped(answer: dict[str, Any]) -> dict[str, Any]:
    """The guess with the segments that a person would choose."""
    sensors: dict[str, Any] = {}
    for triad in answer["triads"]:
        point = triad["columns"][0].split("_", 1)[1].rsplit("_", 1)[0][::-1]
        channels = {"columns": triad["columns"], "unit": triad["unit"]}
        sensors.setdefault(point, {})[triad["quantity"]] = channels
    return {**answer["map"], "hand": "left", "sensors": sensors}


def test_a_table_is_mapped_checked_and_kept_as_a_recording_and_its_map_is_offered_again(
    client: TestClient, patient: int, table: bytes, settings: Settings
) -> None:
    before = files_in(settings)
    answer = sent(client, patient, table)
    assert answer.status_code == 201, answer.text
    at = f"/api/patients/{patient}/tables/{answer.json()['table']}"
    seen = client.get(at).json()
    assert seen["layout"] == {"delimiter": ";", "decimal": ",", "header": True, "skip": 0}
    assert (seen["map"]["time"], seen["stored"]) == ({"column": "zeit", "unit": "ms"}, None)
    assert {t["unit"] for t in seen["triads"]} == {"deg/s", "g"}
    assert len(seen["rows"]) == 8 and "," in seen["rows"][0][0]
    columns = mapped(seen)
    found = client.post(f"{at}/check", json={"map": columns}).json()
    texts = [f["text"] for f in found["findings"]]
    assert "accelerometers read 1.00 at rest: taken as g" in texts
    pose = pose_and_wiggle("left").events[0]
    typed = {"trial_type": "initial_pose", "onset": pose.onset, "duration": pose.duration}
    made = client.post(f"{at}/recording", json={"map": columns, "events": [typed], "method": "m2"})
    assert made.status_code == 201, made.text
    result = finished(client, made.json()["result"])
    assert (result["state"], result["error"], result["method"]) == ("done", "", "m2")
    session = client.get(f"/api/sessions/{made.json()['session']}").json()
    assert (session["hand"], session["recordings"][0]["name"]) == ("left", "log.csv")
    assert client.get(at).status_code == 404
    assert len(files_in(settings) - before) == 1

    again = sent(client, patient, table).json()["table"]
    stored = client.get(f"/api/patients/{patient}/tables/{again}").json()["stored"]
    assert stored["map"] == {k: v for k, v in columns.items() if k not in ("hand", "geometry")}
    assert client.delete(f"/api/patients/{patient}/tables/{again}").status_code == 204
    with client.app.state.parts.store.database() as db:  # type: ignore[attr-defined]
        kinds = {line.kind for line in db.query(AuditLine).filter(AuditLine.what == "created")}
    assert {"session", "recording", "column_map"} <= kinds


def test_a_map_that_the_numbers_contradict_is_refused_and_nothing_is_kept(
    client: TestClient, patient: int, table: bytes, settings: Settings
) -> None:
    at = f"/api/patients/{patient}/tables/{sent(client, patient, table).json()['table']}"
    before = files_in(settings)
    columns = mapped(client.get(at).json())
    for sensor in columns["sensors"].values():
        sensor["acc"]["unit"] = "m/s^2"
    for address in ("check", "recording"):
        answer = client.post(f"{at}/{address}", json={"map": columns})
        assert (answer.status_code, answer.json()["code"]) == (422, "import.gravity_implausible")
    nameless = {"trial_type": "task", "onset": 1, "duration": 2}
    answer = client.post(f"{at}/recording", json={"map": columns, "events": [nameless]})
    assert answer.json()["code"] == "import.task_without_name"
    assert client.get(f"/api/patients/{patient}").json()["sessions"] == []
    assert files_in(settings) == before
    client.delete(at)


def test_a_layout_that_does_not_fit_is_said_beside_the_rows(
    client: TestClient, patient: int, table: bytes
) -> None:
    at = f"/api/patients/{patient}/tables/{sent(client, patient, table).json()['table']}"
    wrong = client.get(at, params={"delimiter": ",", "decimal": "."}).json()
    assert wrong["problem"] and wrong["rows"] and wrong["map"] is None
    same = client.get(at, params={"delimiter": ",", "decimal": ","})
    assert (same.status_code, same.json()["code"]) == (422, "import.delimiter_is_decimal_mark")
    client.delete(at)


def test_only_the_login_that_sent_a_table_sees_it_and_only_the_newest_are_there(
    client: TestClient, patient: int, log_in_as: Callable[..., TestClient]
) -> None:
    rows = b"t,x,y,z\n" + b"".join(b"%d,1,2,3\n" % k for k in range(20))
    numbers = [
        sent(client, patient, rows, "../../a b.csv").json()["table"]
        for _ in range(pending_tables.MOST + 1)
    ]
    answers = [client.get(f"/api/patients/{patient}/tables/{n}") for n in numbers]
    assert [a.status_code for a in answers] == [404, 200, 200, 200]
    assert answers[-1].json()["name"] == "a b.csv"
    other = log_in_as("clinician")
    assert other.get(f"/api/patients/{patient}/tables/{numbers[-1]}").status_code == 404


@pytest.mark.parametrize(
    ("data", "code"), [(b"", "import.empty"), (b"\0\1\2" * 50, "import.unknown_format")]
)
def test_what_is_no_table_is_refused_when_it_is_sent(
    client: TestClient, patient: int, settings: Settings, data: bytes, code: str
) -> None:
    before = files_in(settings)
    answer = sent(client, patient, data)
    assert (answer.status_code, answer.json()["code"]) == (422, code)
    assert files_in(settings) == before
