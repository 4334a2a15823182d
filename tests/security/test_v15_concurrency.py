"""ASVS 5, 15.4.2: two therapists on one patient, two administrators on one account, at once: nothing that either of them wrote is lost unseen."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from tests.faults.victim import Victim
from tests.security.conftest import answer_of, logged_in_as

EDITORS, EDITS = ("anna", "berta"), 6


@pytest.fixture(scope="module")
def editors(victim: Victim) -> list[Victim]:
    """Two browsers, each with a login of its own."""
    return [logged_in_as(victim, name) for name in EDITORS]


def at_once(editors: list[Victim], method: str, path: str, bodies: list[Any]) -> list[int]:
    """Every body sent by both browsers' connections at the same time; the answers' status in their order."""
    with ThreadPoolExecutor(len(bodies)) as pool:
        sent = [
            pool.submit(answer_of, editors[k % len(editors)], method, path, body)
            for k, body in enumerate(bodies)
        ]
        return [future.result()[0] for future in sent]


def test_of_many_changes_to_what_was_seen_one_is_stored_and_the_others_are_refused(
    editors: list[Victim],
) -> None:
    patient = editors[0].call("POST", "/api/patients", {"pseudonym": "P-501"})
    path = f"/api/patients/{patient['id']}"
    changes = [{"version": patient["version"], "year_of_birth": 1950 + k} for k in range(EDITS)]
    answers = at_once(editors, "PATCH", path, changes)
    assert sorted(answers) == [200] + [409] * (EDITS - 1)
    stored = editors[1].call("GET", path)
    assert stored["year_of_birth"] == 1950 + answers.index(200)
    assert stored["version"] == patient["version"] + 1


def test_every_note_that_is_written_at_once_is_kept_and_one_correction_of_a_note_counts(
    editors: list[Victim],
) -> None:
    patient = editors[0].call("POST", "/api/patients", {"pseudonym": "P-502"})["id"]
    path = f"/api/patients/{patient}/notes"
    answers = at_once(editors, "POST", path, [{"text": f"note {k}"} for k in range(EDITS)])
    notes = editors[1].call("GET", f"/api/patients/{patient}")["notes"]
    assert answers == [201] * EDITS
    assert {n["text"] for n in notes} == {f"note {k}" for k in range(EDITS)}
    one, other = notes[0], {"version": notes[0]["version"]}
    bodies = [{**other, "text": "corrected"}, {**other, "removed": True}]
    assert sorted(at_once(editors, "PATCH", f"/api/notes/{one['id']}", bodies)) == [200, 409]


def test_a_refusal_says_what_happened_and_the_other_change_is_merged_on_what_is_stored(
    editors: list[Victim],
) -> None:
    anna, berta = editors
    patient = anna.call("POST", "/api/patients", {"pseudonym": "P-503"})
    path, seen = f"/api/patients/{patient['id']}", patient["version"]
    anna.call("PATCH", path, {"version": seen, "year_of_birth": 1960})
    late, words = answer_of(berta, "PATCH", path, {"version": seen, "dominant_hand": "left"})
    assert late == 409 and "changed in another window meanwhile" in words["error"]
    newest = berta.call("GET", path)["version"]
    berta.call("PATCH", path, {"version": newest, "dominant_hand": "left"})
    both = anna.call("GET", path)
    assert (both["year_of_birth"], both["dominant_hand"]) == (1960, "left")


def test_a_code_that_two_make_at_once_is_one_patients(editors: list[Victim]) -> None:
    answers = at_once(editors, "POST", "/api/patients", [{"pseudonym": "P-504"}] * EDITS)
    assert sorted(answers) == [201] + [422] * (EDITS - 1)


def test_of_many_changes_to_an_account_one_is_stored_and_the_others_are_refused(
    victim: Victim,
) -> None:
    made = victim.call("POST", "/api/accounts", {"name": "carla", "roles": ["clinician"]})
    path, seen = f"/api/accounts/{made['id']}", {"version": made["version"]}
    wishes: list[dict[str, Any]] = [
        {"roles": ["scientist"]},
        {"disabled": True},
        {"roles": ["clinician", "scientist"]},
        {"wards": []},
    ]
    answers = at_once([victim], "PATCH", path, [{**seen, **wish} for wish in wishes])
    assert sorted(answers) == [200] + [409] * 3
    stored = next(a for a in victim.call("GET", "/api/accounts") if a["name"] == "carla")
    done = wishes[answers.index(200)]
    before = {name: made[name] for name in ("roles", "disabled", "wards")}
    assert {name: stored[name] for name in before} == {**before, **done}
    late, words = answer_of(victim, "PATCH", path, {**seen, "disabled": True})
    assert late == 409 and "account 'carla' was changed in another window" in words["error"]
    assert answer_of(victim, "PATCH", path, {"disabled": True})[0] == 422, "a version is needed"


def test_a_change_of_an_account_is_stored_whole_or_not_at_all(victim: Victim) -> None:
    made = victim.call("POST", "/api/accounts", {"name": "dora", "roles": ["clinician"]})
    wish = {"version": made["version"], "wards": [], "roles": ["king"]}
    assert answer_of(victim, "PATCH", f"/api/accounts/{made['id']}", wish)[0] == 404
    stored = next(a for a in victim.call("GET", "/api/accounts") if a["name"] == "dora")
    assert (stored["wards"], stored["version"]) == (made["wards"], made["version"])
