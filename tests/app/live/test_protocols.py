"""Tasks as data: those of the folder are good, a faulty file is named with its fault."""

import json
from pathlib import Path

import pytest

import app.protocols
from app.live.ghost import angles_of
from app.protocols import load_all, protocol_of
from estimators.errors import InputError
from estimators.hand_anatomy import IS_DOF, JOINT, LIMITS
from estimators.simulation import tasks

GOOD = {"name": "x", "title": "X", "instruction": "Do x.", "duration": 5.0, "countdown": 3.0, "curve": "aperture", "order": 1}


def test_every_file_of_the_folder_is_a_task_with_a_name_of_its_own() -> None:
    found = load_all()
    assert len(found) == len(list(Path(app.protocols.__file__).parent.glob("*.json"))) >= 5
    for name, p in found.items():
        assert (p.name, bool(p.title), p.instruction.endswith(".")) == (name, True, True)
        assert p.cue in tasks.TASKS


def test_ghosts_stay_within_what_joints_permit() -> None:
    for p in load_all().values():
        for pose in p.ghost:
            angles = angles_of(pose)
            assert (angles[~IS_DOF] == 0).all()
            assert ((angles >= LIMITS[..., 0] - 1e-9) & (angles <= LIMITS[..., 1] + 1e-9))[IS_DOF].all(), p.name
            assert angles[JOINT["index_pip"], 0] >= 0


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"curve": "elbow_flexion"}, "curve 'elbow_flexion' is neither aperture nor a joint angle"),
        ({"needs": ["toe"]}, "names 'toe', which is no segment"),
        ({"ghost": [{"index_pip_twist": 4}]}, "names 'index_pip_twist'"),
        ({"speed": 3}, r"unknown entries \['speed'\]"),
    ],
)
def test_a_fault_in_a_file_is_named(change: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError, match=f"protocol x.json.*{sentence}"):
        protocol_of("x.json", json.dumps({**GOOD, **change}))


def test_an_incomplete_or_broken_file_is_named() -> None:
    with pytest.raises(InputError, match=r"x\.json is incomplete.*title"):
        protocol_of("x.json", json.dumps({k: v for k, v in GOOD.items() if k != "title"}))
    with pytest.raises(InputError, match=r"x\.json is not valid JSON"):
        protocol_of("x.json", "{")
