"""Assessment plans over the API: Handscope's own, the clinic's versions of them, and files from other houses."""

from types import SimpleNamespace
from typing import Any

import pytest
from starlette.testclient import TestClient

from handscope.app.live.stations import live_setup
from handscope.app.protocols import load_all
from handscope.app.protocols.plans import applied, built_in, named, plan_of
from handscope.app.settings import Settings

BASE = "/api/assessment-plans"
DIAGNOSES = {
    *("flexor_tendon_repair", "distal_radius_fracture", "crps", "stroke", "parkinson"),
    *("carpal_tunnel", "hand_osteoarthritis"),
}


def _content(client: TestClient, name: str = "crps") -> Any:
    return client.get(f"{BASE}/{name}/file.json").json()


def test_seven_diagnoses_come_with_tasks_that_there_are_and_with_sources(
    client: TestClient,
) -> None:
    listed = {row["name"]: row for row in client.get(BASE).json()}
    assert set(listed) >= DIAGNOSES
    for name in DIAGNOSES:
        plan_of(listed[name]["content"], load_all())
        assert len(listed[name]["content"]["sources"]) >= 2


def test_a_change_is_a_new_version_and_the_older_one_stays(client: TestClient) -> None:
    content = _content(client)
    content["tasks"] = [{"task": "tapping", "trials": 2, "seconds": 10.0}, {"task": "rom_fist"}]
    made = client.post(BASE, json={"content": content, "seen": 1})
    assert (made.status_code, made.json()["version"], made.json()["own"]) == (201, 2, True)
    assert _content(client) == {**content, "version": 2}
    first = client.get(f"{BASE}/crps/file.json", params={"version": 1}).json()
    assert [t["task"] for t in first["tasks"]] != ["tapping", "rom_fist"]
    late = client.post(BASE, json={"content": content, "seen": 1})
    assert late.status_code == 409
    assert client.delete(f"{BASE}/crps").status_code == 204
    assert "crps" not in {row["name"] for row in client.get(BASE).json()}
    assert client.get(f"{BASE}/crps", params={"version": 2}).json()["version"] == 2


def test_a_plan_that_was_withdrawn_comes_back_from_its_file(client: TestClient) -> None:
    content = _content(client, "stroke")
    assert client.post(BASE, json={"content": content, "seen": 1}).status_code == 201
    assert client.delete(f"{BASE}/stroke").status_code == 204
    listed = {row["name"]: row["version"] for row in client.get(BASE).json()}
    file = {"content": content, "seen": listed.get("stroke", 0)}  # as the page sends it
    made = client.post(BASE, json=file)
    assert (made.status_code, made.json()["version"]) == (201, 3)
    assert {row["name"]: row["version"] for row in client.get(BASE).json()}["stroke"] == 3
    assert client.post(BASE, json=file).status_code == 409, "somebody brought it back meanwhile"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"tasks": [{"task": "juggling"}]}, "task juggling, which is not known"),
        ({"tasks": [{"task": "rom_fist"}, {"task": "rom_fist"}]}, "stands twice"),
        ({"tasks": [{"task": "rom_mcp", "seconds": 9.0}]}, "does not end by time"),
        ({"tasks": [{"task": "rom_fist", "repetitions": 3}]}, "has no rounds"),
        ({"tasks": []}, "field tasks"),
        ({"sources": []}, "field sources"),
        ({"colour": "red"}, "field colour"),
        ({"name": "Two words"}, "field name"),
    ],
)
def test_a_file_that_cannot_be_followed_is_refused_with_its_field(
    client: TestClient, change: dict[str, Any], words: str
) -> None:
    answer = client.post(BASE, json={"content": {**_content(client, "stroke"), **change}})
    assert answer.status_code == 422 and words in answer.text


def test_a_plan_sets_order_trials_and_seconds_and_leaves_the_other_tasks() -> None:
    plan = built_in()["crps"]
    tasks = applied(plan, load_all())
    assert [p.name for p in tasks.values() if p.routine] == [t.task for t in plan.tasks]
    assert (tasks["tremor_posture"].duration, tasks["open_close"].trials) == (15.0, 1)
    assert set(tasks) == set(load_all()) and not tasks["tapping"].routine


def test_a_recording_names_the_plan_and_its_version(settings: Settings) -> None:
    plan = built_in()["parkinson"]
    session = SimpleNamespace(id=1, hand="left", geometry={}, trunk_height=None)
    setup = live_setup("m2", {}, settings.data, plan)(session, settings.data / "x", "/dev/x", "P")  # type: ignore[arg-type]
    assert setup.metadata["plan"] == named(plan) == {
        "name": "parkinson", "version": 1, "title": "Parkinson's disease"
    }  # fmt: skip
    assert setup.protocols[0].name == "tapping" and setup.plan_title == "Parkinson's disease"
