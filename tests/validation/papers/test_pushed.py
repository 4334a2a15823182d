"""What is left after a functional calibration: the steps are in the recording, and only the variant that is to use them does."""

from handscope.estimators.alignment.functional_movements import STEPS
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.validation.papers import pushed
from handscope.validation.papers.pushed import VARIANTS
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.experiments import Trial, calibrating


def test_only_after_the_steps_are_the_steps_used() -> None:
    recording = calibrating(Trial("A-F2", 0))
    kinds = [e.trial_type for e in recording.events]
    assert kinds[0] == "initial_pose" and kinds[-1] == "task" and set(STEPS) == set(kinds[1:-1])
    used = {
        v: process(m2, params, recording).calibrations[0].steps for v, params in VARIANTS.items()
    }
    assert {v for v, steps in used.items() if steps} == {"after the steps"}


def test_means_over_the_table_are_told_by_variant() -> None:
    results = [
        (Trial("A-F2", seed), dict.fromkeys(VARIANTS, (1.0 + seed, 2.0, 3.0))) for seed in (0, 1)
    ]
    found = pushed.finding(Wanted(seeds=2), results)
    assert (
        "pose alone: fingertip 1.50 cm, the finger's angles 2.00 deg, all angles 3.00 deg on average."
        in found.remarks
    )
    assert found.tables[0].rows[0].ours["after the steps"].worst == 2.0
