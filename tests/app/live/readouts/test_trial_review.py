"""Before a trial is kept: its figures beside earlier ones, every finger that counts, marks, and what was wrong with it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from handscope.app.language import languages
from handscope.app.live.readouts import trial_review
from handscope.app.live.readouts.trial_review import (
    LEAST,
    EarlierFigures,
    TrialReview,
    localised_review,
    lost_heading,
    problem_of,
    review,
)
from handscope.app.protocols import load_all
from handscope.app.results.quantity_curve import value_of
from handscope.estimators.data.samples import Block
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.hand.anatomy import FINGERS, SEGMENT
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures import repetitions
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import IDEAL

PROTOCOLS = load_all()
NOTHING = EarlierFigures()


@pytest.fixture(scope="module")
def fist() -> Simulated:
    return simulate(
        ["initial_pose", "rom_fist"], "left", sized("left"), np.random.default_rng(3), IDEAL
    )


def trial_of(made: Simulated) -> tuple[float, float, tuple[tuple[float, float], ...]]:
    (task,) = [e for e in made.events if e.trial_type == "task"]
    return task.onset, task.end, ()


def test_a_fist_shows_all_four_fingers_three_figures_and_a_mark_a_movement(
    fist: Simulated,
) -> None:
    earlier = EarlierFigures(
        last={("range_of_motion", "rom_fist", "index_pip_flexion_max"): (1.0, "rad")}
    )
    blocks = list(fist.samples.values())
    protocol = replace(PROTOCOLS["rom_fist"], duration=None)
    found = review(
        fist.truth, blocks, protocol, "index_pip_flexion", trial_of(fist), sized("left"), earlier
    )
    assert [c["what"].split("_")[0] for c in found["curves"]] == list(FINGERS[1:])
    assert [f["finger"] for f in found["fingers"]] == list(FINGERS[1:])
    assert len(found["marks"]) == 3 and found["problem"] is None
    first = found["figures"][0]
    assert len(found["figures"]) == 3 and first["figure"] == "index_pip_flexion_max"
    assert [f["end"] for f in found["figures"]] == ["max", "min", "range"]
    assert first["last"] == pytest.approx(np.degrees(1.0)) and first["other"] is None
    words = localised_review(found, languages()["de"])
    assert words is not None and words["figures"][0]["last"] == "57°"


def test_of_fingers_that_are_spread_the_larger_excursion_is_shown_with_its_direction() -> None:
    made = simulate(["rom_spread"], "left", sized("left"), np.random.default_rng(3), IDEAL)
    blocks, trial = list(made.samples.values()), trial_of(made)
    protocol, curve = PROTOCOLS["rom_spread"], PROTOCOLS["rom_spread"].curve
    found = review(made.truth, blocks, protocol, curve, trial, sized("left"), NOTHING)
    went = {f["finger"]: f["value"] for f in found["fingers"]}
    assert went["index"] == pytest.approx(-17, abs=0.5)  # away from the middle finger
    assert went["little"] == pytest.approx(40, abs=0.5)


def test_contacts_are_no_movements_that_are_marked_and_counted(fist: Simulated) -> None:
    protocol = replace(PROTOCOLS["rom_fist"], group=PROTOCOLS["touch_table"].group)
    blocks, trial = list(fist.samples.values()), trial_of(fist)
    found = review(fist.truth, blocks, protocol, "index_pip_flexion", trial, sized("left"), NOTHING)
    assert found["curves"] and found["marks"] == []


@pytest.mark.parametrize("task", ["tapping", "rom_fist", "open_close"])
@pytest.mark.parametrize("late", [0.0, 0.13, 1.7])  # s that the trial begins after the movement
def test_there_is_a_mark_for_every_tap_and_every_repetition_that_is_counted(
    task: str, late: float
) -> None:
    made = simulate(["initial_pose", task], "left", sized("left"), np.random.default_rng(5), IDEAL)
    onset, end, pauses = trial_of(made)
    curve = PROTOCOLS[task].curve
    found = review(
        made.truth,
        list(made.samples.values()),
        PROTOCOLS[task],
        curve,
        (onset + late, end, pauses),
        sized("left"),
        NOTHING,
    )
    shown = value_of(made.truth.between(onset + late, end), curve)
    counted = found["taps"] if task == "tapping" else repetitions.count(shown, LEAST)
    assert len(found["marks"]) == counted > 1
    assert all(onset + late <= mark <= end for mark in found["marks"])


def test_what_is_below_zero_is_said_in_words() -> None:
    row = {"figure": "tapping_decrement_ratio", "part": "", "what": "tapping_decrement_ratio"}
    values = {"unit": "%", "value": -19.2, "sd": None, "last": -4.0, "other": 2.0}
    words = localised_review({"figures": [{**row, **values, "end": "", "grade": "good"}]}, languages()["en"])  # fmt: skip
    assert words is not None
    (figure,) = words["figures"]
    assert [figure[name] for name in ("value", "last", "other")] == ["19.2 % smaller", "4.0 % smaller", "2.0 % larger"]  # fmt: skip
    bent = {"figure": "index_pip_flexion_min", "part": "index", "what": "", "unit": "deg"}
    ends = {"value": -7.0, "sd": None, "last": 4.0, "other": None}
    words = localised_review({"figures": [{**bent, **ends, "end": "min", "grade": "good"}]}, languages()["en"])  # fmt: skip
    assert words is not None
    assert [words["figures"][0][name] for name in ("value", "last")] == [
        "7° hyperextension",
        "4° extension deficit",
    ]


def test_a_range_names_its_joint_and_the_direction_of_each_end() -> None:
    ends = {"flexion_max": 49.0, "flexion_min": -46.0, "deviation_min": -20.0}
    rows = [
        {"figure": f"wrist_{what}", "part": "wrist", "what": what, "unit": "deg", "value": value}
        | {"sd": None, "last": None, "other": None, "grade": "good", "end": what[-3:]}
        for what, value in ends.items()
    ]
    words = localised_review({"figures": rows}, languages()["en"])
    assert words is not None
    assert [(f["label"], f["value"]) for f in words["figures"]] == [
        ("Wrist, flexion", "49°"),
        ("Wrist, extension", "46°"),
        ("Wrist, radial", "20°"),
    ]


def without_some(block: Block, share: float) -> Block:
    """The block with this share of its samples missing."""
    kept = np.arange(len(block.t)) >= share * len(block.t)
    return Block(block.stream, block.t[kept], block.values[kept])


@pytest.mark.parametrize(
    ("share", "length", "repetitions", "kind"),
    [
        (0.0, None, 3, None),
        (0.3, None, 3, "lost"),
        (0.0, 60.0, 3, "early"),
        (0.0, None, 5, "few"),
    ],
)
def test_what_was_wrong_is_said_the_gravest_alone(
    fist: Simulated, share: float, length: float | None, repetitions: int, kind: str | None
) -> None:
    onset, end, _ = trial_of(fist)
    blocks = [without_some(b.between(onset, end), share) for b in fist.samples.values()]
    protocol = replace(PROTOCOLS["rom_fist"], duration=length, repetitions=repetitions)
    values = value_of(fist.truth.between(onset, end), "index_pip_flexion")
    problem = problem_of(blocks, protocol, "index_pip_flexion", values, (onset, end, ()))
    assert (problem and problem["kind"]) == kind
    if kind == "lost":
        assert problem is not None and problem["percent"] == pytest.approx(100 * share, abs=2)


def test_a_heading_that_was_lost_is_said_before_all_else(fist: Simulated) -> None:
    onset, end, _ = trial_of(fist)
    rows = fist.truth.between(onset, end)
    assert lost_heading(rows) is None
    flags = rows.flags.copy()
    flags[:, SEGMENT["ring_middle"]] |= np.uint8(Flag.HEADING_LOST)
    lost = replace(rows, flags=flags)
    assert lost_heading(lost) == {"kind": "heading"}
    trial = (onset, end, ())
    found = review(
        lost, [], PROTOCOLS["rom_fist"], "index_pip_flexion", trial, fist.geometry, EarlierFigures()
    )
    assert found["problem"] == {"kind": "heading"}


def test_a_movement_that_could_not_be_followed_is_said(fist: Simulated) -> None:
    onset, end, _ = trial_of(fist)
    blocks = [b.between(onset, end) for b in fist.samples.values()]
    problem = problem_of(
        blocks, PROTOCOLS["tapping"], "aperture", np.full(100, np.nan), (onset, end, ())
    )
    assert problem == {"kind": "unknown", "percent": 100}


def test_a_review_that_fails_is_told_by_its_number(
    fist: Simulated, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page must not wait for it."""

    def fail(*_: object) -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr(trial_review, "review", fail)
    tracking = SimpleNamespace(past=lambda *_: fist.truth, samples=lambda _: [])
    reviews = TrialReview(tracking, fist.geometry, NOTHING)  # type: ignore[arg-type]
    onset, end, _ = trial_of(fist)
    reviews._of = ("rom_fist", onset, end)
    reviews._review(reviews._of, PROTOCOLS["rom_fist"], "index_pip_flexion", ())
    assert (reviews.number, reviews.payload()) == (1, None)
