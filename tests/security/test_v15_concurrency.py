"""ASVS 5, 15.4.2: two therapists on one patient at once, in two browsers: nothing that either of them wrote is lost unseen."""

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
