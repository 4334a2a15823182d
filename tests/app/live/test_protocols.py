"""Tasks as data: those of the folder are good and are what the papers ask for, a faulty file is named with its field and what is allowed."""

import json
from pathlib import Path

import numpy as np
import pytest

import app.protocols
from app.cli import main
from app.devices.virtual_glove.wearer import BRIDGE, IN_STEP
from app.live.ghost import angles_of
from app.live.telling import LEAST
from app.protocols import Protocol, groups, load_all, protocol_of
from estimators.errors import InputError
from estimators.hand_anatomy import FINGERS, IS_DOF, JOINT, LIMITS
from estimators.hand_geometry import sized
from estimators.measures import MEASURES, repetitions
from estimators.simulation import tasks
from estimators.simulation.motion import COORDINATES

GOOD = {"name": "x", "title": "X", "instruction": "Do x.", "group": "g", "duration": 5.0, "curve": "aperture", "order": 1}
PACED = {"duration": None, "cycle": [{"say": "Bend", "seconds": 1.0}], "repetitions": 2}
ALL = load_all()
POWERGLOVE = [p for p in ALL.values() if p.group == "powerglove"]
IN_TIME = [p for p in ALL.values() if p.cue.startswith(IN_STEP)]


def test_every_file_of_the_folder_is_a_task_with_a_name_of_its_own() -> None:
    assert len(ALL) == len(list(Path(app.protocols.__file__).parent.glob("*.json"))) >= 22
    assert len({p.order for p in ALL.values()}) == len({p.title for p in ALL.values()}) == len(ALL)
    for p in ALL.values():
        assert p.title
        assert p.instruction.endswith(".")
        assert p.cue in tasks.TASKS


def test_the_usual_assessment_is_what_it_was_and_comes_first() -> None:
    assert [p.name for p in ALL.values() if p.routine] == ["rom_fist", "rom_spread", "rom_thumb", "rom_wrist", "tapping"]
    assert groups(ALL.values()) == ["range_of_motion", "tapping", "powerglove", "repeatability"]


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
    measured = {number for number, p in enumerate(POWERGLOVE, 1) if MEASURES["tapping"].applies(p.name)}
    assert measured == {11, 12}


@pytest.mark.parametrize(("name", "closed"), [("repeatability_flat", "fist"), ("repeatability_mould", "grip")])
def test_the_repeatability_protocol_holds_6_s_and_6_s_ten_times_in_ten_trials_a_minute_apart(name: str, closed: str) -> None:
    p = ALL[name]
    assert ([phase.seconds for phase in p.cycle], p.repetitions, p.trials, p.pause) == ([6.0, 6.0], 10, 10, 60.0)
    marks = p.marks(100.0, 220.0)
    assert [(start, phase.mark) for start, phase, _ in marks] == [(100.0 + 6 * k, "flat" if k % 2 else closed) for k in range(20)]
    assert [repetition for _, _, repetition in marks] == [1 + k // 2 for k in range(20)]
    assert [start for start, _, _ in p.marks(100.0, 117.0)] == [100.0, 106.0]  # stopped early: whole phases only
    assert len(p.marks(100.0, 219.9)) == 20  # a tick early


@pytest.mark.parametrize("p", IN_TIME, ids=lambda p: p.name)
def test_the_virtual_patient_begins_with_the_task_and_does_what_its_file_asks_for(p: Protocol) -> None:
    lead = p.countdown - BRIDGE
    performance = tasks.TASKS[p.cue](sized("left"), lead=lead)
    event = performance.events[0]
    assert (event.trial_type, event.details["task_name"], event.onset) == ("task", p.name, lead)
    assert p.length is None or event.duration == pytest.approx(p.length, abs=1e-6)
    waiting = performance.motion.at(np.linspace(1.0, lead, 50))[0]
    np.testing.assert_allclose(waiting, waiting[[0]].repeat(50, axis=0), atol=1e-9)
    assert [(e.onset, e.details["phase"]) for e in performance.events[1:]] == [
        (pytest.approx(start), phase.mark) for start, phase, _ in p.marks(lead, event.end)
    ]
    if p.repetitions:
        t = np.arange(event.onset, event.end, 1 / 60)
        curve = np.degrees(performance.motion.at(t)[0][:, COORDINATES[p.curve]])
        assert repetitions.count(curve, LEAST) == p.repetitions


def test_ghosts_stay_within_what_joints_permit() -> None:
    for p in ALL.values():
        for pose in p.ghost:
            angles = angles_of(pose)
            assert (angles[~IS_DOF] == 0).all()
            assert ((angles >= LIMITS[..., 0] - 1e-9) & (angles <= LIMITS[..., 1] + 1e-9))[IS_DOF].all(), p.name
            assert angles[JOINT["index_pip"], 0] >= 0


def test_a_task_names_the_fingers_that_its_ghost_moves_as_needed() -> None:
    for p in POWERGLOVE[:9]:
        moving = {f for f in FINGERS[1:] if any(pose.get(f"{f}_{j}_flexion") for pose in p.ghost for j in ("mcp", "pip", "dip"))}
        assert {name.split("_")[0] for name in p.needs} == moving


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"curve": "elbow_flexion"}, r"curve is 'elbow_flexion'; it is aperture or a joint angle such as index_pip_flexion$"),
        ({"needs": ["toe"]}, r"needs names 'toe', which is no segment; segments are forearm, hand, .*little_distal$"),
        (
            {"ghost": [{}, {"index_pip_twist": 4}]},
            r"ghost\[1\] names 'index_pip_twist', which is no joint angle such as index_pip_flexion$",
        ),
        ({"ghost": [{"index_pip_flexion": "a"}]}, r"ghost\[0\]\.index_pip_flexion is 'a'; it should be a valid number$"),
        ({"speed": 3}, r"speed is no field; fields are name, title, .*cue_details$"),
        ({"duration": -1}, r"duration is -1; it should be greater than 0$"),
        ({"duration": "15 s"}, r"duration is '15 s'; it should be a valid number$"),
        ({"trials": 0}, r"trials is 0; it should be greater than or equal to 1$"),
        ({"trials": True}, r"trials is True; it should be a valid integer$"),
        ({"group": "My tasks"}, r"group is 'My tasks'; it should be small letters, digits and _, beginning with a letter$"),
        ({"name": "y"}, r"name is 'y'; it is the file's name without \.json$"),
        ({"cycle": PACED["cycle"]}, r"duration and cycle are both given; .* so leave duration out$"),
        ({**PACED, "repetitions": None}, r"repetitions is missing; a task with a cycle needs a number of them, 1 to 100$"),
        ({**PACED, "cycle": [{"say": "Bend"}]}, r"cycle\[0\]\.seconds is missing$"),
        (
            {**PACED, "cycle": [{"say": "Bend", "second": 1}]},
            r"cycle\[0\]\.second is no field; fields are say, seconds, mark \(and 1 more\)$",
        ),
        ({**PACED, "cycle": [{"say": "Bend", "seconds": 0}]}, r"cycle\[0\]\.seconds is 0; it should be greater than 0$"),
        ({"pause": 60}, r"pause is given, but there is one trial only; give trials, or leave pause out$"),
    ],
)
def test_a_fault_in_a_file_is_named_with_its_field_and_what_is_allowed(change: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError, match=rf"^protocol x\.json: {sentence}"):
        protocol_of("x.json", json.dumps({**GOOD, **change}))


def test_an_incomplete_or_broken_file_is_named() -> None:
    protocol_of("x.json", json.dumps({**GOOD, **PACED}))
    for text, sentence in (
        (json.dumps({k: v for k, v in GOOD.items() if k != "title"}), "title is missing$"),
        ("{", "is not valid JSON"),
        ("[]", "the file should hold one object with the fields name, "),
        (json.dumps({**GOOD, "duration": float("nan")}), "duration is nan; it should be a finite number$"),
    ):
        with pytest.raises(InputError, match=rf"^protocol x\.json: .*{sentence}"):
            protocol_of("x.json", text)


def test_a_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_bytes(b"\xff\xfe{")
    with pytest.raises(InputError, match=r"protocol x\.json is not text in UTF-8; save it as UTF-8"):
        load_all(tmp_path)


def test_the_server_does_not_start_with_a_faulty_file_and_says_why_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "protocols"
    folder.mkdir()
    (folder / "x.json").write_text(json.dumps({**GOOD, "countdown": -3}))
    monkeypatch.setattr(app.protocols, "files", lambda package: folder)
    assert main(["serve", "--port", "0", "--data", str(tmp_path / "data")]) == 2
    said = capsys.readouterr().err
    assert said == "handscope serve: protocol x.json: countdown is -3; it should be greater than or equal to 0\n"


def test_the_example_in_the_docs_is_a_task() -> None:
    text = (Path(__file__).parents[3] / "docs" / "extending.md").read_text("utf-8")
    example = text.split("```json\n")[1].split("```")[0]
    assert protocol_of("wrist_turns.json", example).length == 15.0
