"""Kortier's chapter 2: figures of one person hang together, pinches close, and the thesis' figures stand beside ours."""

import numpy as np
import pytest

from handscope.estimators.data.fingertip_contacts import FINGERTIPS, contact_points_of
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.experiments import KORTIER2, judged_samples
from handscope.estimators.simulation.scenario import InertialGlove, simulate_performances
from handscope.estimators.simulation.sensors import IDEAL
from handscope.validation.papers import kortier2, published
from handscope.validation.papers.kortier2 import FAST, HOLDS, TIPS, WITH, Found
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.experiments import Trial


def test_the_tips_error_is_made_of_its_parts_along_the_axes() -> None:
    found = kortier2.measure(Trial("brisk flexion", 0)).figures
    for name in WITH:
        assert found[name]["tip"] ** 2 == pytest.approx(sum(found[name][c] ** 2 for c in "xyz"))
        assert 0.1 < found[name]["tip"] < 30.0


def test_ten_pinches_are_closed_where_they_are_judged() -> None:
    experiment, geometry = KORTIER2["pinch"], sized("left")
    made = simulate_performances(
        experiment.perform(geometry, np.random.default_rng(3)),
        "left",
        geometry,
        np.random.default_rng(4),
        IDEAL,
        glove=InertialGlove(segments=("hand",)),
    )
    tasks = [e for e in made.events if e.trial_type == "task"]
    assert len(tasks) == 10 and all(0.5 < e.duration < 1.3 for e in tasks)
    a, b = (
        contact_points_of(made.truth, geometry, finger, point, FINGERTIPS[finger])
        for finger, point in experiment.contact
    )
    apart = np.linalg.norm(a - b, axis=1)
    assert apart[judged_samples(made)].max() < 1e-3
    assert apart.max() > 0.03


def test_the_thesis_stands_beside_ours() -> None:
    figures = {
        **{name: {"x": 1.0, "y": 2.0, "z": 2.0, "tip": 3.0} for name in TIPS},
        **{name: {"range": 1.5, "SD": 0.5} for name in HOLDS},
        FAST: {"PIP": 2.0, "range lost": 1.0, "peak": 1100.0},
    }
    results = [(Trial(name, 0), Found(dict.fromkeys(WITH, figures[name]))) for name in figures]
    found = kortier2.finding(Wanted(seeds=1), results)
    met = {v.what: v.met for v in found.verdicts}
    assert met[f"brisk flexion, {WITH[0]}"] and met[f"pinch, {WITH[0]}"]
    assert not met[f"flat hand, range, {WITH[0]}"] and met[f"clenched mould, range, {WITH[0]}"]
    assert {row.name: row.theirs[WITH[0]] for row in found.tables[0].rows} == {
        n: published.KORTIER_TIP[n]["tip"] for n in TIPS
    }
