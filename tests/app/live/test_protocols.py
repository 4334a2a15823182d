"""Tasks as data: those of the folder are good and are what the papers ask for, a faulty file is named with its field and what is allowed."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from handscope.app import protocols
from handscope.app.devices.virtual_glove.wearer import BRIDGE, UNDERSTOOD, SimulatedPerson, layout
from handscope.app.language import Language, languages
from handscope.app.live.ghost import angles_of
from handscope.app.live.snapshot import LEAST
from handscope.app.live.trial_events import CLOSING, LEAVING
from handscope.app.protocols import (
    TURN,
    Protocol,
    groups,
    load_all,
    load_free,
    load_steps,
    offered,
    protocol_of,
    read,
)
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.estimators.data.events import Event
from handscope.estimators.data.fingertip_contacts import palm_mark
from handscope.estimators.data.held_contact import held_contacts, parse_contacts
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import DOF_NAMES, FINGERS, HANDS, IS_DOF, JOINT, LIMITS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures import MEASURES, repetitions
from handscope.estimators.measures.sustained_angle_measures import palm_turn
from handscope.estimators.messages.sentence import codes_of
from handscope.estimators.simulation import kinematics
from handscope.estimators.simulation.motion import COORDINATES
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.assessment_tasks import RANGES
from handscope.estimators.simulation.movements.grasp_postures import Hold, contact_offset
from handscope.estimators.simulation.movements.touched_surfaces import lowest_point
from handscope.estimators.simulation.sensors import IDEAL

GOOD = {
    "name": "x",
    "title": "X",
    "instruction": "Do x.",
    "group": "g",
    "duration": 5.0,
    "curve": "aperture",
    "order": 1,
}
PACED = {"duration": None, "cycle": [{"say": "Bend", "seconds": 1.0}], "repetitions": 2}
ALL = load_all()
GROUPS = [
    "range_of_motion",
    "tapping",
    "range_of_motion_joints",
    "range_of_motion_passive",
    "opposition",
    "repeated_movements",
    "contacts",
    "independence",
    "pinch",
    "selfcheck",
    "tremor",
    "reach",
    "force",
    "powerglove",
    "repeatability",
]
POWERGLOVE = [p for p in ALL.values() if p.group == "powerglove"]
IN_TIME = [p for p in ALL.values() if p.cue in task_performance.IN_STEP]


def test_every_file_of_the_folder_is_a_task_with_a_name_of_its_own() -> None:
    assert len(ALL) == len(list(Path(protocols.__file__).parent.glob("*.json"))) == 63
    assert read()[1] == []
    assert len({p.order for p in ALL.values()}) == len({p.title for p in ALL.values()}) == len(ALL)
    for p in ALL.values():
        assert p.title
        assert p.instruction.endswith(".")
        assert p.cue in UNDERSTOOD
        assert p.ghost


def test_the_usual_assessment_is_what_it_was_and_comes_first() -> None:
    assert [p.name for p in ALL.values() if p.routine] == [
        "rom_fist",
        "rom_spread",
        "rom_thumb",
        "rom_wrist",
        "tapping",
    ]
    assert groups(ALL.values()) == GROUPS


def test_the_15_tasks_have_pace_repetitions_trials_and_times_of_table_3_1() -> None:
    assert [int(p.name.split("_")[1]) for p in POWERGLOVE] == list(range(1, 16))
    assert {p.trials for p in POWERGLOVE} == {3}
    for number, p in enumerate(POWERGLOVE, 1):
        if number <= 9 or number == 14:
            assert (1 / p.period, p.repetitions, p.length) == (0.5, 10, 20.0)
        elif number == 15:
            assert (p.cycle, p.repetitions, p.length) == ((), 10, None)
        else:
            assert (p.cycle, p.repetitions, p.length) == ((), None, 30.0)
    measured = {
        number for number, p in enumerate(POWERGLOVE, 1) if MEASURES["tapping"].applies(p.name)
    }
    assert measured == {11, 12}


@pytest.mark.parametrize(
    ("name", "closed"), [("repeatability_flat", "fist"), ("repeatability_mould", "grip")]
)
def test_the_repeatability_protocol_holds_6_s_and_6_s_ten_times_in_ten_trials_a_minute_apart(
    name: str, closed: str
) -> None:
    p = ALL[name]
    assert ([phase.seconds for phase in p.cycle], p.repetitions, p.trials, p.pause) == (
        [6.0, 6.0],
        10,
        10,
        60.0,
    )
    marks = p.marks(100.0, 220.0)
    assert [(start, phase.mark) for start, phase, _ in marks] == [
        (100.0 + 6 * k, "flat" if k % 2 else closed) for k in range(20)
    ]
    assert [repetition for _, _, repetition in marks] == [1 + k // 2 for k in range(20)]
    assert [start for start, _, _ in p.marks(100.0, 117.0)] == [
        100.0,
        106.0,
    ]  # stopped early: whole phases only
    assert len(p.marks(100.0, 219.9)) == 20  # a tick early


@pytest.mark.parametrize("p", IN_TIME, ids=lambda p: p.name)
def test_the_virtual_patient_begins_with_the_task_and_does_what_its_file_asks_for(
    p: Protocol,
) -> None:
    lead = p.countdown - BRIDGE
    performance = task_performance.TASKS[p.cue](sized("left"), lead=lead)
    event = performance.events[0]
    assert (event.trial_type, event.details["task_name"], event.onset) == ("task", p.cue, lead)
    assert p.length is None or event.duration == pytest.approx(p.length, abs=1e-6)
    waiting = performance.motion.at(np.linspace(1.0, lead, 50))[0]
    np.testing.assert_allclose(waiting, waiting[[0]].repeat(50, axis=0), atol=1e-9)
    assert [(e.onset, e.details["phase"]) for e in performance.events[1:]] == [
        (pytest.approx(start), phase.mark) for start, phase, _ in p.marks(lead, event.end)
    ]
    if p.repetitions and p.repetitions > 1 and p.curve in COORDINATES:
        t = np.arange(event.onset, event.end, 1 / 60)
        curve = np.degrees(performance.motion.at(t)[0][:, COORDINATES[p.curve]])
        assert repetitions.count(curve, LEAST) == p.repetitions


def test_ghosts_stay_within_what_joints_permit() -> None:
    for p in ALL.values():
        for pose in p.ghost:
            angles = angles_of({name: value for name, value in pose.items() if name != TURN})
            assert (angles[~IS_DOF] == 0).all()
            assert ((angles >= LIMITS[..., 0] - 1e-9) & (angles <= LIMITS[..., 1] + 1e-9))[
                IS_DOF
            ].all(), p.name
            assert angles[JOINT["index_pip"], 0] >= 0


def test_a_task_names_the_fingers_that_its_ghost_moves_as_needed() -> None:
    for p in POWERGLOVE[:9]:
        moving = {
            f
            for f in FINGERS[1:]
            if any(pose.get(f"{f}_{j}_flexion") for pose in p.ghost for j in ("mcp", "pip", "dip"))
        }
        assert {name.split("_")[0] for name in p.needs} == moving


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            {"curve": "elbow_flexion"},
            r"curve is 'elbow_flexion'; it is aperture, palm_turn or a joint angle such as index_pip_flexion$",
        ),
        (
            {"needs_any": ["toe"]},
            r"needs_any names 'toe', which is no segment and no sensor's place; they are forearm, .*",
        ),
        (
            {"needs_any": ["hand"], "needs_count": 2},
            r"needs_count is 2, but needs_any names 1$",
        ),
        (
            {"needs": ["toe"]},
            r"needs names 'toe', which is no segment and no sensor's place; they are forearm, hand, .*trunk_mag_32$",
        ),
        (
            {"ghost": [{}, {"index_pip_twist": 4}]},
            r"ghost\[1\] names 'index_pip_twist', which is no joint angle such as index_pip_flexion$",
        ),
        (
            {"ghost": [{"index_pip_flexion": "a"}]},
            r"ghost\[0\]\.index_pip_flexion is 'a'; it should be a valid number$",
        ),
        ({"speed": 3}, r"speed is no field; fields are name, title, .*cue_details$"),
        ({"duration": -1}, r"duration is -1; it should be greater than 0$"),
        ({"duration": "15 s"}, r"duration is '15 s'; it should be a valid number$"),
        ({"trials": 0}, r"trials is 0; it should be greater than or equal to 1$"),
        ({"trials": True}, r"trials is True; it should be a valid integer$"),
        (
            {"group": "My tasks"},
            r"group is 'My tasks'; it should be small letters, digits and _, beginning with a letter$",
        ),
        ({"name": "y"}, r"name is 'y'; it is the file's name without \.json$"),
        (
            {"cycle": PACED["cycle"]},
            r"duration and cycle are both given; .* so leave duration out$",
        ),
        (
            {**PACED, "repetitions": None},
            r"repetitions is missing; a task with a cycle needs a number of them, 1 to 100$",
        ),
        ({**PACED, "cycle": [{"say": "Bend"}]}, r"cycle\[0\]\.seconds is missing$"),
        (
            {**PACED, "cycle": [{"say": "Bend", "second": 1}]},
            r"cycle\[0\]\.second is no field; fields are say, seconds, mark, contacts \(and 1 more\)$",
        ),
        (
            {**PACED, "cycle": [{"say": "Bend", "seconds": 0}]},
            r"cycle\[0\]\.seconds is 0; it should be greater than 0$",
        ),
        (
            {"pause": 60},
            r"pause is given, but there is one trial only; give trials, or leave pause out$",
        ),
    ],
)
def test_a_fault_in_a_file_is_named_with_its_field_and_what_is_allowed(
    change: dict[str, object], sentence: str
) -> None:
    with pytest.raises(InputError, match=rf"^protocol x\.json(, line 1)?: {sentence}"):
        protocol_of("x.json", json.dumps({**GOOD, **change}))


def test_an_incomplete_or_broken_file_is_named() -> None:
    protocol_of("x.json", json.dumps({**GOOD, **PACED}))
    for text, sentence in (
        (json.dumps({k: v for k, v in GOOD.items() if k != "title"}), "title is missing$"),
        ("{", "is not valid JSON"),
        ("[]", "the file should hold one object with the fields name, "),
        (
            json.dumps({**GOOD, "duration": float("nan")}),
            "duration is nan; it should be a finite number$",
        ),
    ):
        with pytest.raises(InputError, match=rf"^protocol x\.json(, line 1)?: .*{sentence}"):
            protocol_of("x.json", text)


def test_a_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_bytes(b"\xff\xfe{")
    assert read(tmp_path) == ({}, ["protocol x.json is not text in UTF-8; save it as UTF-8"])


def test_a_faulty_file_is_left_out_and_does_not_stop_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "protocols"
    folder.mkdir()
    (folder / "x.json").write_text(json.dumps({**GOOD, "countdown": -3}))
    (folder / "y.json").write_text(json.dumps({**GOOD, "name": "y"}))
    fault = "protocol x.json, line 1: countdown is -3; it should be greater than or equal to 0"
    found, faults = read(folder)
    assert (list(found), faults) == (["y"], [fault])
    monkeypatch.setattr(protocols, "files", lambda package: folder)
    create_app(Settings(data=tmp_path / "data"))
    assert [r.getMessage() for r in caplog.records if "protocol" in r.getMessage()] == [
        f"{fault}. This task is not offered, the others are."
    ]


def test_a_file_dropped_into_the_data_folder_is_offered_and_a_broken_one_is_named_with_its_line(
    tmp_path: Path,
) -> None:
    known, none = offered(tmp_path)
    assert (known, none) == (ALL, [])
    own = tmp_path / "protocols"
    own.mkdir()
    (own / "x.json").write_text(json.dumps({**GOOD, "order": -1}))
    (own / "broken.json").write_text('{\n  "name": "broken",\n  "title": "T"\n  "group": "g"\n}')
    (own / "wrong.json").write_text(
        json.dumps(
            {
                **GOOD,
                "name": "wrong",
                **PACED,
                "cycle": [{"say": "Up", "seconds": 1}, {"say": "Down", "seconds": 0}],
            },
            indent=1,
        )
    )
    (own / "tapping.json").write_text(json.dumps({**GOOD, "name": "tapping"}))
    found, faults = offered(tmp_path)
    assert list(found) == ["x", *ALL] and found["tapping"] == ALL["tapping"]
    line = next(
        k
        for k, text in enumerate((own / "wrong.json").read_text().splitlines(), 1)
        if '"seconds": 0' in text
    )
    assert faults == [
        "protocol broken.json: is not valid JSON (expected `,` or `}` at line 4 column 3)",
        f"protocol wrong.json, line {line}: cycle[1].seconds is 0; it should be greater than 0",
        "protocol tapping.json: name is 'tapping', as a task of Handscope has it; choose another",
    ]
    (own / "x.json").unlink()
    assert list(offered(tmp_path)[0]) == list(ALL)  # read anew for every session


@pytest.mark.parametrize("mode", ["active", "passive"])
def test_every_joint_is_taken_to_both_ends_three_times_by_patient_and_therapist(mode: str) -> None:
    found = {
        p.name.removeprefix("p"): p
        for p in ALL.values()
        if p.group == f"range_of_motion_{'joints' if mode == 'active' else mode}"
    }
    assert {p.mode for p in found.values()} == {mode}
    assert set(found) - {"rom_fist"} == set(RANGES) - {"reach"}
    moved = {
        angle
        for p in found.values()
        for g in p.ghost
        for angle in g
        if len({h.get(angle, 0.0) for h in p.ghost}) > 1
    }
    assert {name for name in DOF_NAMES if name.endswith("flexion")} <= moved
    for name, p in found.items():
        assert p.repetitions == 3
        assert tuple(phase.mark for phase in p.cycle) == (
            RANGES[name].phases if name in RANGES else ()
        )


def test_a_held_contact_is_the_distance_that_the_protocol_keeps_for_the_measures() -> None:
    geometry = sized("left")
    for task, p in ((p.name, p) for p in ALL.values() if p.group == "selfcheck"):
        assert p.length is not None
        streams = layout(FINGERS, 100.0)
        person = SimulatedPerson("left", geometry, streams, np.random.default_rng(2), IDEAL)
        assert person.cue(task, {"lead": f"{p.countdown:g}"}, 2.0)
        t = (
            2.0 + p.countdown + np.arange(0.2, 9.5 if p.cycle else 19.0, 0.5)
        )  # the virtual patient holds it at least so long
        x = person.doing(t)
        for contact, distance in zip(
            p.details["contacts"].split(), p.details["distances_mm"].split()
        ):
            (a, b) = (tuple(end.split("_")) for end in contact.split("-"))
            apart = np.linalg.norm(contact_offset(x, Hold(a, b, 0.0), geometry), axis=1)
            np.testing.assert_allclose(1e3 * apart, float(distance), atol=0.1)


def test_the_virtual_patient_holds_each_fingertip_while_its_contact_lasts() -> None:
    """The pads meet to the millimetres that a person misses their middles by."""
    geometry, p = sized("left"), ALL["touch_fingertips"]
    person = SimulatedPerson(
        "left", geometry, layout(FINGERS, 100.0), np.random.default_rng(2), IDEAL
    )
    assert person.cue(p.cue, {"lead": f"{p.countdown:g}"}, 2.0)
    begin = 2.0 + p.countdown
    for start, phase, _ in p.marks(begin, begin + 18.0):
        assert phase.contacts
        t = start + np.arange(CLOSING, phase.seconds - LEAVING - 0.3, 0.1)
        (contact,) = parse_contacts({"contacts": phase.contacts})
        hold = Hold(contact.a, contact.b, 0.0)
        apart = np.linalg.norm(contact_offset(person.doing(t), hold, geometry), axis=1)
        assert apart.max() < 0.02
        assert np.ptp(apart) < 1e-4


@pytest.mark.parametrize("task", ["touch_table", "touch_palm"])
def test_the_virtual_patient_holds_table_and_palm_while_their_contacts_last(task: str) -> None:
    """Fingertips lie in one plane, or a tip within millimetres of its mark, and nothing moves."""
    geometry, p = sized("left"), ALL[task]
    person = SimulatedPerson(
        "left", geometry, layout(FINGERS, 100.0), np.random.default_rng(2), IDEAL
    )
    assert person.cue(p.cue, {"lead": f"{p.countdown:g}"}, 2.0)
    begin = 2.0 + p.countdown
    marks = p.marks(begin, begin + p.period)
    assert len(marks) == len(p.cycle)
    for start, phase, _ in marks:
        t = np.array([start + CLOSING, start + phase.seconds - LEAVING - 0.3])
        (held,) = held_contacts([Event(t[0], 1.0, "contact", {"contacts": phase.contacts})])
        x = person.doing(t)
        np.testing.assert_allclose(x[0], x[1], atol=1e-9)
        up = np.array([1.0, 0.0, 0.0])  # of a left hand
        if held.on_table:
            heights = [lowest_point(x[0], geometry, f, -up)[0] for f in held.fingers]
            assert len(heights) == 5
            assert np.ptp(heights) < 0.012
        else:
            (finger,), (_, below) = held.fingers, held.contacts[0].b
            mark = geometry.joint_positions[f"{below}_mcp"] + palm_mark(geometry)
            assert np.linalg.norm(lowest_point(x[0], geometry, finger, up) - mark) < 0.02


@pytest.mark.parametrize("one", languages().values(), ids=lambda one: one.code)
def test_every_task_and_step_is_demonstrated_and_explained_in_two_sentences(one: Language) -> None:
    every = [*ALL.values(), *load_steps().values(), load_free()]
    assert [p.name for p in every if not p.ghost] == []
    words = {p.name: one.translate(p.instruction) for p in every}
    ends = {name: len(re.findall(r"[.!?](?=\s|$)", text)) for name, text in words.items()}
    assert {name: count for name, count in ends.items() if count != 2} == {}


@pytest.mark.parametrize(
    "one", [one for one in languages().values() if one.code != "en"], ids=lambda one: one.code
)
def test_every_language_says_every_task(one: Language) -> None:
    texts = {t for p in ALL.values() for t in (p.title, p.instruction, *(c.say for c in p.cycle))}
    texts |= {t for p in ALL.values() if p.score for t in (p.score.title, p.score.hint)}
    assert sorted(t for t in texts if not codes_of(t) <= one.messages.keys()) == []
    score = ALL["tapping"].score
    assert score and one.translate(score.title) == "MDS-UPDRS 3.4"  # a name, no number


def test_the_palm_turn_is_0_palm_down_and_150_palm_up_on_either_hand() -> None:
    for hand in HANDS:
        person = task_performance.TASKS["rom_forearm"](sized(hand))
        t = np.array([1.0, 3.4])
        k = kinematics.true_trajectory(
            kinematics.compute_kinematics(person.motion, sized(hand), t), hand
        )
        np.testing.assert_allclose(np.degrees(palm_turn(k)), [0.0, 150.0], atol=1e-6)


def test_the_example_in_the_docs_is_a_task() -> None:
    text = (Path(__file__).parents[3] / "docs" / "extending.md").read_text("utf-8")
    example = text.split("```json\n")[1].split("```")[0]
    assert protocol_of("wrist_turns.json", example).length == 15.0
