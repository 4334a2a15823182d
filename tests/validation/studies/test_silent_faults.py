"""Faults put into recordings of the outside simulator: what they cost, and whether anything is said of them."""

import numpy as np
import pytest

from handscope.estimators.data.samples import GYR
from handscope.estimators.hand.anatomy import CHAINS
from handscope.validation.independent.simulator import free_movement
from handscope.validation.reproduce import Wanted
from handscope.validation.studies import silent_faults
from handscope.validation.studies.crosschecks import Made
from handscope.validation.studies.silent_faults import BENT, FAULTS, Case, Choice, Trial

CHOICE = Choice("ring", 1, 0, 14.0)


@pytest.fixture(scope="module")
def made() -> tuple[Made, free_movement.Truth]:
    return silent_faults.recorded("resting", 4)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_touches_its_own_sensors_only(
    made: tuple[Made, free_movement.Truth], name: str
) -> None:
    spoil, is_whole = FAULTS[name]
    (before,), (after,) = made[0].blocks, spoil(made[0], CHOICE).blocks
    n = min(len(before.t), len(after.t))
    changed = (before.values[:n] != after.values[:n]).any(axis=(0, 2))
    touched = {s for s, c in zip(before.stream.sensors, changed) if c}
    mine = {*CHAINS["ring"], *(CHAINS["little"] + CHAINS["index"] if "fingers" in name else ())}
    assert is_whole or (touched and touched <= mine)


def test_the_second_half_is_spoilt_from_half_way_on(
    made: tuple[Made, free_movement.Truth],
) -> None:
    (before,), (after,) = made[0].blocks, FAULTS["gain 1.3, second half"][0](made[0], CHOICE).blocks
    changed = (before.of(GYR) != after.of(GYR)).any(axis=(1, 2))
    np.testing.assert_array_equal(changed, before.t >= CHOICE.half)


def test_samples_after_dropped_rows_are_judged_by_when_they_were_taken(
    made: tuple[Made, free_movement.Truth],
) -> None:
    recording, truth = made
    clean = silent_faults._errors(recording, truth, "m2")
    dropped = silent_faults._errors(
        FAULTS["1.5 s of rows dropped"][0](recording, CHOICE), truth, "m2"
    )
    assert clean is not None and dropped is not None
    assert dropped["ring"] < 1.4 * clean["ring"]  # a hand at rest loses nothing by it


def test_a_fault_is_silent_where_it_costs_much_and_no_code_is_said() -> None:
    costs = {"m2": 2.0, "ekf": float("nan")}
    cases = {name: Case((), {"m2": 1.0, "ekf": 1.1}) for name in (*FAULTS, *BENT)}
    results = [
        (Trial("tapping", 1), {**cases, "gain 1.3": Case((), costs)}),
        (Trial("free", 1), {**cases, "gain 1.3": Case(("sensor.gyroscope_gain",), costs)}),
        (Trial("resting", 1), {**cases, "gain 1.3": Case((), costs, is_untested=True)}),
    ]
    found = silent_faults.finding(Wanted(), results)
    row = next(r for r in found.tables[0].rows if r.name == "gain 1.3")
    assert [row.ours[c].mean for c in found.tables[0].columns] == [3, 3, 2, 1, 2.0]
    assert found.remarks[0] == (
        "2 of 3 costly faults without a word; 1 of them neither found nor told as untested."
    )
