"""Contacts that the simulator keeps exactly, and what the task says of them."""

import numpy as np
import pytest

from handscope.estimators.data.held_contact import parse_contacts
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures import pinch, self_check
from handscope.estimators.measures.contacts import error_statistics
from handscope.estimators.measures.task_request import Mark, TaskRequest
from handscope.estimators.simulation.movements import static_hold
from handscope.estimators.simulation.movements.task_performance import initial_pose
from handscope.estimators.simulation.scenario import simulate_performances
from handscope.estimators.simulation.sensors import IDEAL
from tests.estimators.measures.trajectories import by_name, made


@pytest.mark.parametrize(
    ("name", "perform", "pairs"),
    [
        ("selfcheck_p1", static_hold.spacer_thumb_index, ["thumb_index"]),
        ("selfcheck_p2", static_hold.spacer_index_middle, ["index_middle"]),
        ("selfcheck_p4", static_hold.block, ["thumb_index", "thumb_middle", "index_middle"]),
    ],
)
def test_what_is_truly_held_has_no_error(name: str, perform: object, pairs: list[str]) -> None:
    geometry = sized("right")
    done = perform(geometry, np.random.default_rng(2), sway=0.0)  # type: ignore[operator]
    recording = simulate_performances(
        [initial_pose(geometry), done], "right", geometry, np.random.default_rng(1), IDEAL
    )
    task = next(e for e in recording.events if e.trial_type == "task")
    found = self_check.measure(
        self_check.Params(), recording.truth, task.onset, task.end, geometry, TaskRequest(name)
    )
    f = by_name(self_check.figures(found))
    assert [r.contact.part for r in found] == pairs
    for pair in pairs:
        assert f[f"{pair}_contact_error_rmse"].value < 1e-4


def test_the_task_says_which_points_and_how_far_apart() -> None:
    details = {
        "contacts": "thumb_bottom-index_bottom index_left-middle_right nose_left-ear_right",
        "distances_mm": "53 25",
    }
    a, b = parse_contacts(details)
    assert (a.a, a.b, a.distance) == (("thumb", "bottom"), ("index", "bottom"), 0.053)
    assert (b.part, b.distance) == ("index_middle", 0.025)
    assert (
        parse_contacts({"contacts": "thumb_distal-index_distal", "distances_mm": "many"})[
            0
        ].distance
        is None
    )
    assert parse_contacts({}) == []


def test_errors_are_mean_scatter_and_root_mean_square() -> None:
    e = error_statistics(np.array([0.031, 0.033, np.nan, 0.032]), 0.030)
    assert e["mean"] == pytest.approx(0.002)
    assert e["sd"] == pytest.approx(0.001)
    assert e["rmse"] == pytest.approx(np.sqrt(14 / 3) * 1e-3)


def test_only_what_is_marked_as_closed_is_judged() -> None:
    """Tips at 0 mm while closed (with 1 s to react), at 60 mm else."""
    tips = np.zeros((1000, 5, 3))
    t = np.arange(1000) / 100
    tips[(t < 2) | (t > 7), 1, 1] = 0.06
    asked = TaskRequest(
        "selfcheck_p3",
        {"contacts": "thumb_distal-index_distal", "distances_mm": "0"},
        (Mark(1.5, 7.4, "closed", 1),),
    )
    (found,) = self_check.measure(
        self_check.Params(), made(1000, tips=tips), 0.0, 10.0, None, asked
    )
    assert error_statistics(found.distance, 0.0)["rmse"] == 0
    assert "between the ends of the bones" in self_check.figures([found])[0].reason
    (whole,) = self_check.measure(
        self_check.Params(), made(1000, tips=tips), 0.0, 10.0, None, TaskRequest("selfcheck_p3")
    )
    assert error_statistics(whole.distance, 0.0)["rmse"] > 0.02


def test_a_task_that_says_nothing_has_figures_that_say_so() -> None:
    figures = self_check.figures(self_check.measure(self_check.Params(), made(100), 0, 1))
    assert {f.reason for f in figures} == {self_check.UNDECLARED}
    assert np.isnan([f.value for f in figures]).all()


def test_pinches_are_counted_and_their_distances_told() -> None:
    tips = np.zeros((1000, 5, 3))
    t = np.arange(1000) / 100
    tips[:, 1, 1] = 0.010 + 0.025 * (1 - np.cos(2 * np.pi * t / 2.0))
    f = by_name(pinch.figures(pinch.measure(pinch.Params(), made(1000, tips=tips), 0.0, 10.0)))
    assert (
        f["thumb_index_pinch_count"].value == 4
    )  # those at the very ends are not seen as closings
    assert f["thumb_index_pinch_distance_min"].value == pytest.approx(0.010, abs=1e-3)
    assert f["thumb_index_pinch_distance_closed"].value == pytest.approx(0.010, abs=1e-3)
    assert f["thumb_index_pinch_aperture_max"].value == pytest.approx(0.060, abs=1e-3)


def test_a_finger_that_was_not_measured_is_named() -> None:
    (figure, *_) = pinch.figures(pinch.measure(pinch.Params(), made(100), 0, 1))
    assert figure.reason == "thumb or index not measured"
