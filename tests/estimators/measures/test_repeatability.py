"""Reliability against the worked example of Shrout & Fleiss 1979 and against what was simulated; range and SD as in Table 2.3."""

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import DOF_NAMES
from handscope.estimators.measures.repeatability import (
    held_angles,
    posture_spread,
    reliability,
    within_groups,
)
from tests.estimators.measures.movements import moving
from tests.simulated import DEG

SHROUT_FLEISS = np.array(
    [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]], float
)  # Table 2: 6 targets, 4 judges


def test_the_worked_example_of_shrout_and_fleiss() -> None:
    found = reliability(SHROUT_FLEISS)
    assert (found.targets, found.sessions) == (6, 4)
    assert round(found.icc_agreement.value, 2) == 0.29  # Table 4: ICC(2,1)
    assert round(found.icc_consistency.value, 2) == 0.71  # ICC(3,1)
    # intervals as R's psych prints them for this example
    assert (round(found.icc_agreement.low, 3), round(found.icc_agreement.high, 2)) == (0.019, 0.76)
    assert (round(found.icc_consistency.low, 2), round(found.icc_consistency.high, 2)) == (
        0.34,
        0.95,
    )
    # Table 3: between judges 32.49, residual 1.02, within targets 6.26
    assert found.sem_consistency.value == pytest.approx(np.sqrt(1.02), abs=0.005)
    assert (
        found.sem.value
        == pytest.approx(np.sqrt(1.02 + (32.49 - 1.02) / 6), abs=0.005)
        == pytest.approx(np.sqrt(6.26), abs=0.005)
    )
    assert found.mdc95.value == pytest.approx(1.96 * np.sqrt(2) * found.sem.value)


def test_a_session_that_reads_more_costs_agreement_and_not_consistency() -> None:
    rng = np.random.default_rng(1)
    people = rng.normal(60, 10, (30, 1)) + rng.normal(0, 2, (30, 2))
    shifted = people + np.array([0.0, 8.0])
    before, after = reliability(people), reliability(shifted)
    assert after.icc_consistency.value == pytest.approx(before.icc_consistency.value)
    assert after.icc_agreement.value < before.icc_agreement.value - 0.1
    assert after.sem.value > 2 * after.sem_consistency.value


def test_sem_and_its_interval_hold_what_was_put_in() -> None:
    rng, inside = np.random.default_rng(2), 0
    for _ in range(300):
        sem = reliability(rng.normal(60, 10, (12, 1)) + rng.normal(0, 3, (12, 4))).sem
        inside += sem.low <= 3.0 <= sem.high
    assert 0.91 < inside / 300 < 0.985  # 95 %


def test_a_change_of_nothing_exceeds_the_mdc_once_in_twenty() -> None:
    rng = np.random.default_rng(3)
    mdc = reliability(rng.normal(60, 10, (400, 1)) + rng.normal(0, 3, (400, 3))).mdc95.value
    change = np.diff(rng.normal(0, 3, (20000, 2)), axis=1)
    assert (np.abs(change) > mdc).mean() == pytest.approx(0.05, abs=0.01)


def test_one_patient_has_an_sem_but_no_icc() -> None:
    found = reliability(np.array([[50.0, 53.0, 47.0, 52.0]]))
    assert found.sem.value == pytest.approx(np.std([50, 53, 47, 52], ddof=1))
    assert np.isnan(found.icc_agreement.value)
    assert found.mdc95.low < found.mdc95.value < found.mdc95.high


def test_within_groups_of_unequal_size_is_the_mean_square_of_an_analysis_of_variance() -> None:
    found = within_groups([[1.0, 3.0], [10.0], [5.0, 5.0, 8.0]])
    assert found is not None
    assert (found.measurements, found.freedom) == (5, 3)
    assert found.sem.value == pytest.approx(np.sqrt((2 + 6) / 3))
    assert within_groups([[1.0], [2.0]]) is None
    equal = within_groups(SHROUT_FLEISS.tolist())
    assert equal is not None
    assert equal.sem.value == pytest.approx(reliability(SHROUT_FLEISS).sem.value)
    rng = np.random.default_rng(5)
    sems = [
        w.sem
        for _ in range(1500)
        if (
            w := within_groups(
                [rng.normal(m, 3, k).tolist() for m, k in ((50, 2), (70, 3), (60, 1), (65, 4))]
            )
        )
    ]
    assert 0.935 < np.mean([i.low <= 3.0 <= i.high for i in sems]) < 0.965  # 95 %


def test_incomplete_and_equal_measurements() -> None:
    holes = SHROUT_FLEISS.copy()
    holes[2, 1] = np.nan
    assert reliability(holes) == reliability(np.delete(SHROUT_FLEISS, 2, axis=0))
    equal = reliability(np.array([[1.0, 1.0], [2.0, 2.0], [4.0, 4.0]]))
    assert (equal.icc_agreement.value, equal.sem.value, equal.mdc95.value) == (1.0, 0.0, 0.0)
    assert np.isnan(reliability(np.full((3, 2), 5.0)).icc_agreement.value)
    for values in (np.array([[1.0], [2.0]]), np.full((3, 2), np.nan), np.arange(4.0)):
        with pytest.raises(InputError, match="at least two sessions"):
            reliability(values)


def test_range_and_sd_are_taken_within_a_trial_and_averaged_over_the_trials() -> None:
    held = np.zeros((2, 10, 1))
    held[0, :, 0] = np.arange(10)  # range 9, SD 3.03
    held[1, :, 0] = 100 + 2 * np.arange(10)  # what lies between the trials does not count
    found = posture_spread(held, ["index_pip_flexion"])
    assert found.range[0] == pytest.approx(13.5)
    assert found.sd[0] == pytest.approx(1.5 * np.std(np.arange(10), ddof=1))
    assert found.overall == pytest.approx((13.5, 1.5 * np.std(np.arange(10), ddof=1)))
    with pytest.raises(InputError, match="two holds a trial"):
        posture_spread(held[:, :1], ["index_pip_flexion"])


def test_the_range_over_ten_holds_is_three_standard_deviations() -> None:
    held = np.random.default_rng(4).normal(scale=0.4, size=(2000, 10, 1))
    found = posture_spread(held, ["index_pip_flexion"])
    assert found.range[0] / 0.4 == pytest.approx(
        3.078, abs=0.05
    )  # d2 of ten values; Table 2.3 has 1.1 / 0.4


def test_a_hold_counts_without_its_ends() -> None:
    t = np.arange(0, 24, 0.01)
    angle = np.where(t % 12 < 6, 10 * DEG, 80 * DEG) + np.where(t > 12, 1 * DEG, 0.0)
    settling = np.where((t % 6 < 0.9) | (t % 6 > 5.1), 30 * DEG, 0.0)
    moved = moving(t, np.stack([angle + settling, angle, angle], axis=-1))
    held = held_angles(moved, [(0.0, 6.0), (12.0, 18.0)])
    flat = held[:, DOF_NAMES.index("index_mcp_flexion")]
    np.testing.assert_allclose(flat, np.array([10, 11]) * DEG, atol=0.01 * DEG)
    assert np.isnan(held[:, DOF_NAMES.index("little_dip_flexion")]).all()
    found = posture_spread(held[None])
    assert found.range[DOF_NAMES.index("index_mcp_flexion")] == pytest.approx(
        1 * DEG, abs=0.01 * DEG
    )
    assert np.isnan(found.range[DOF_NAMES.index("little_dip_flexion")])
    with pytest.raises(InputError, match="nothing remains"):
        held_angles(moved, [(0.0, 1.5)])
