"""The whole hand as one problem, forearm included: through `process`, as a user meets it; limbs that share the hand know more of each other than alone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, DEVIATION, FINGERS, FLEXION, JOINT
from handscope.estimators.hand.geometry import HandGeometry, sized
from handscope.estimators.methods import BATCH
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.self_calibration import mounting_shift, segments, solver
from handscope.estimators.self_calibration.problem import parameter_columns
from handscope.estimators.self_calibration.solver import Solution
from handscope.estimators.self_calibration.whole_hand import solver as whole_hand_solver
from handscope.estimators.self_calibration.whole_hand.problem import TURN_AND_SLIDE
from handscope.estimators.self_calibration.whole_hand.solver import HandSolution
from handscope.estimators.simulation.movements import free_movement
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from tests.estimators.self_calibration.fingers import watched

DEG = np.pi / 180
METHOD = BATCH["map"]
TWO = ("index", "middle")
WORN = ("forearm", "hand", *(s for f in TWO for s in CHAINS[f]))
DURATION = 12.0  # s


@dataclass(frozen=True)
class Case:
    """A recording calibrated, and what was solved on the way."""

    made: Simulated
    geometry: HandGeometry  # true
    done: Processed
    alone: Sequence[Solution]  # as they came to their end
    together: HandSolution


def _recorded() -> tuple[Simulated, HandGeometry]:
    """Two fingers 5 % longer and shorter than an average hand's, with all errors of sensors and skin."""
    average = sized("left")
    grown = {
        s: length * (1.05 if s.endswith("proximal") else 0.95)
        for s, length in average.lengths.items()
    }
    true = replace(average, lengths=grown)
    return free_movement.record_trial(
        np.random.default_rng(11), SensorErrors(), "left", true, average, WORN, DURATION
    ), true


@pytest.fixture(scope="session")
def case() -> Case:
    """Solved once; what passes by the whole hand's solver is kept."""
    made, true = _recorded()
    with pytest.MonkeyPatch.context() as patch:
        alone: list[Any] = []
        together: list[Any] = []
        patch.setattr(solver, "solve_with_noise", _kept(solver.solve_with_noise, alone))
        patch.setattr(whole_hand_solver, "solve", _kept(whole_hand_solver.solve, together))
        done = process(METHOD, METHOD.Params(), made)
    return Case(made, true, done, alone, *together)


def _kept(function: Callable[..., Any], found: list[Any]) -> Callable[..., Any]:
    def called(*given: Any) -> Any:
        found.append(function(*given))
        return found[-1]

    return called


@pytest.mark.slow
def test_a_hand_is_calibrated_with_its_fingers_at_once(case: Case) -> None:
    """From an average hand's lengths and nominal mountings."""
    found = case.done.calibrations[0]
    assert case.together.outcome == "converged"
    for name in (f"{f}_{s}" for f in TWO for s in ("proximal", "middle")):
        assert found.geometry.lengths[name] == pytest.approx(case.geometry.lengths[name], rel=0.02)
        assert found.lengths_sd[name] < 0.015 * found.geometry.lengths[name]
    assert {o.share for f in TWO for o in watched(case.made, f)} == {1.0}, (
        "the live meter promises what was found"
    )
    moved, truth = case.done.trajectory, case.made.truth
    inside = (moved.t > 2.0) & (moved.t < DURATION - 2.0)
    for joint in ("index_pip", "middle_pip"):
        off = (moved.angles - truth.angles)[inside, JOINT[joint], FLEXION]
        assert np.sqrt(np.mean(off**2)) < 2.0 * DEG


def test_the_wrist_is_followed_by_the_forearms_sensor(case: Case) -> None:
    """Its zero is as good as the mountings and is said to be; the movement about it is better by far. Tips are as uncertain as the wrist, too."""
    moved, truth, wrist = case.done.trajectory, case.made.truth, JOINT["wrist"]
    assert moved.angles_sd is not None and moved.tips_sd is not None
    inside = (moved.t > 2.0) & (moved.t < DURATION - 2.0)
    for axis in (FLEXION, DEVIATION):
        off, sd = (a[inside, wrist, axis] for a in (moved.angles - truth.angles, moved.angles_sd))
        assert np.sqrt(np.mean((off / sd) ** 2)) < 2.0
        assert np.std(off) < 1.0 * DEG
        assert sd.max() < 12.0 * DEG
    fingers = [FINGERS.index(f) for f in TWO]
    off, sd = (a[inside][:, fingers] for a in (moved.tips - truth.tips, moved.tips_sd))
    assert np.sqrt(np.mean((off / sd) ** 2)) < 2.0
    found, worn = case.done.calibrations[0], case.made.sensors
    assert (
        np.abs(found.p_BS["forearm"] - worn.p_BS[WORN.index("forearm")])
        < 3.5 * found.p_BS_sd["forearm"]
    ).all()


def test_a_forearm_that_lay_still_costs_no_finger(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    _known(case, monkeypatch)
    monkeypatch.setattr(
        whole_hand_solver, "solve", lambda *others: replace(case.together, outcome="not converged")
    )
    block = case.made.samples["imu"]
    values = block.values.copy()
    values[:, WORN.index("forearm")] = values[:1, WORN.index("forearm")]
    done = process(
        METHOD, METHOD.Params(), replace(case.made, samples={"imu": replace(block, values=values)})
    )
    assert any(
        w.startswith("forearm: it turned at 0 deg/s") and "bending the wrist" in w
        for w in done.warnings
    )
    assert set(done.calibrations[0].lengths_sd) == {
        "index_proximal",
        "index_middle",
        "middle_proximal",
        "middle_middle",
    }
    sd = done.trajectory.angles_sd
    assert sd is not None and (sd[:, JOINT["wrist"], FLEXION] > 30 * DEG).all()


def test_a_finger_alone_is_as_sure_as_the_skin_under_the_hands_sensor_lets_it(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The hand's sensor follows the middle finger, by which its first phalanx alone was too sure."""
    _known(case, monkeypatch)
    block = case.made.samples["imu"]
    rows = [WORN.index(s) for s in ("hand", *CHAINS["middle"])]
    stream = replace(block.stream, sensors=tuple(WORN[k] for k in rows))
    worn = replace(
        case.made, samples={"imu": replace(block, stream=stream, values=block.values[:, rows])}
    )
    found = process(METHOD, METHOD.Params(), worn).calibrations[0]
    name, before = (
        "middle_proximal",
        next(s for s in case.alone if s.problem.chain.sensors[-1] == "middle_distal"),
    )
    told = segments.of_solution(before, "left", case.made.mounting)
    off = [
        abs(x - case.geometry.lengths[name])
        for x in (found.geometry.lengths[name], told.lengths[name])
    ]
    assert off[0] < 2 * found.lengths_sd[name]
    assert found.lengths_sd[name] > 1.3 * told.lengths_sd[name]


def _known(case: Case, patch: pytest.MonkeyPatch) -> None:
    """Limbs alone are as they were solved before, and steady."""
    before = {s.problem.chain.sensors: s for s in case.alone}
    patch.setattr(
        solver, "solve_with_noise", lambda problem, *others: before[problem.chain.sensors]
    )
    patch.setattr(mounting_shift, "find_mounting_shifts", lambda *others: [])


def test_fingers_that_share_the_hand_are_surer_of_themselves(case: Case) -> None:
    """Of what the skin on the hand does not touch: that it follows a neighbour is among the unknowns only where the neighbour is there."""
    before, after = (
        {
            s: sd
            for limb in limbs
            for s, sd in segments.of_solution(limb, "left", case.made.mounting).lengths_sd.items()
        }
        for limbs in (case.alone, whole_hand_solver.split_limbs(case.together))
    )
    for name in ("index_middle", "middle_middle"):
        assert after[name] < 0.97 * before[name]


def test_the_covariance_of_all_parameters_is_honest(case: Case) -> None:
    """Mean squared errors in standard deviations of what the simulation knows: biases, scales; 1 where honest."""
    z: dict[str, list[Array]] = {"acc_bias": [], "scale": [], "length": []}
    worn, true = case.made.sensors, np.linalg.inv(case.made.sensors.matrix) - np.eye(3)
    for limb in whole_hand_solver.split_limbs(case.together):
        c, sd = parameter_columns(limb.problem.chain), np.sqrt(np.diag(limb.factor.covariance))
        rows = [WORN.index(s) for s in limb.problem.chain.sensors]
        z["acc_bias"].append((limb.at.bias_acc - worn.bias[rows, 3:6]).ravel() / sd[c.bias_acc])
        z["scale"] += [
            (limb.at.scale_gyr - true[0][rows]).ravel() / sd[c.scale_gyr],
            (limb.at.scale_acc - true[1][rows]).ravel() / sd[c.scale_acc],
        ]
        told = segments.of_solution(limb, "left", case.made.mounting)
        z["length"].append(
            np.array(
                [
                    (told.lengths[s] - case.geometry.lengths[s]) / told.lengths_sd[s]
                    for s in told.lengths
                ]
            )
        )
    errors = {name: float(np.mean(np.concatenate(off) ** 2)) for name, off in z.items()}
    assert errors["acc_bias"] == pytest.approx(1.0, abs=0.75)
    assert errors["scale"] == pytest.approx(1.0, abs=0.5)
    assert errors["length"] < 4.0


def test_skin_on_the_back_of_the_hand_is_told_apart(case: Case) -> None:
    """It follows the middle finger's flexion, and neither the index finger's nor the wrist's."""
    found, none, hand = case.together, np.zeros(3), WORN.index("hand")
    sd = np.sqrt(np.diag(found.factor.covariance))[found.factor.layout.skin][
        : 3 * TURN_AND_SLIDE
    ].reshape(2, 3, 3)
    true = np.array(
        [
            [none, skin[hand], none]
            for skin in (case.made.sensors.skin_turn, case.made.sensors.skin_slide)
        ]
    )
    off = np.array([found.at.skin_turn, found.at.skin_slide]) - true
    assert np.sqrt(np.mean((off / sd) ** 2)) < 2.0
    assert np.linalg.norm(found.at.skin_turn[1]) > 3 * np.linalg.norm(found.at.skin_turn[0])


def test_where_the_whole_hand_does_not_come_to_an_end_fingers_are_as_they_were_found_alone(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    _known(case, monkeypatch)
    monkeypatch.setattr(
        whole_hand_solver, "solve", lambda *others: replace(case.together, outcome="not converged")
    )
    done = process(METHOD, METHOD.Params(), case.made)
    assert any(
        "hand and fingers as one problem did not come to an end" in said for said in done.warnings
    )
    index = next(s for s in case.alone if "index_proximal" in s.problem.chain.sensors)
    told = segments.of_solution(index, "left", case.made.mounting)
    assert done.calibrations[0].lengths_sd["index_proximal"] == pytest.approx(
        told.lengths_sd["index_proximal"], rel=1e-9
    )


def test_when_the_time_is_over_fingers_are_as_they_were_found_alone(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    _known(case, monkeypatch)

    def over(share: float) -> None:
        if 0.6 <= share < 1.0:
            raise InputError("60 s were not enough")

    done = process(METHOD, METHOD.Params(), case.made, progress=over)
    assert "60 s were not enough" in done.warnings
    assert set(done.calibrations[0].lengths_sd) == {
        "index_proximal",
        "index_middle",
        "middle_proximal",
        "middle_middle",
    }
