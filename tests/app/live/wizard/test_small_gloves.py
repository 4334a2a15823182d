"""What the wizard offers a glove with few sensors: what they measure, and nothing else."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from handscope.app.live.wizard.machine import Action, State, Wizard
from handscope.app.live.wizard.snapshot import wizard_snapshot
from handscope.app.protocols import Protocol, load_all, load_free, load_steps
from handscope.estimators.hand.anatomy import CHAINS, FINGERS
from tests.app.live.wizard.test_machine import READY

TABLE = Path(__file__).parents[4] / "docs" / "build-a-glove.md"
PROTOCOLS, STEPS = load_all(), load_steps()
GLOVES = {
    "one finger": ("hand", *CHAINS["index"]),
    "thumb and index": ("hand", *CHAINS["thumb"], *CHAINS["index"]),
    "hand and forearm": ("hand", "forearm"),
}  # rows of the table
FINGER_TASKS = {
    "open_close",
    *("rom_fist", "rom_spread", "rom_mcp", "rom_pip", "rom_dip"),
    *("prom_fist", "prom_mcp", "prom_pip", "prom_dip"),
    *("repeatability_flat", "repeatability_mould"),
}
TASKS = {
    "one finger": FINGER_TASKS
    | {"tremor_rest", "tremor_posture", "pronation_supination", "rom_forearm", "prom_forearm"}
    | {"circular_pointing", "powerglove_10_index_fast", "powerglove_14_index_sideways"}
    | {f"powerglove_{name}" for name in ("01_index_mcp", "02_index_pip_dip", "03_index_all")}
    | {"powerglove_13_open_close", "powerglove_15_index_circles", "touch_palm"},
    "hand and forearm": {
        *("tremor_rest", "tremor_posture", "pronation_supination", "rom_forearm", "prom_forearm"),
        *("rom_wrist", "rom_wrist_flexion", "rom_wrist_deviation"),
        *("prom_wrist_flexion", "prom_wrist_deviation"),
    },
}
TASKS["thumb and index"] = TASKS["one finger"] | {
    *("tapping", "tapping_10", "tapping_30", "powerglove_11_tapping", "pinches", "kapandji"),
    *("rom_thumb", "rom_thumb_ip", "rom_thumb_mcp", "rom_thumb_palmar", "rom_thumb_radial"),
    *("prom_thumb_ip", "prom_thumb_mcp", "prom_thumb_palmar", "prom_thumb_radial"),
    *("finger_independence", "reach", "selfcheck_p1", "selfcheck_p3", "touch_fingertips"),
}
FLEXIONS = {"flat_hand", "flexion_mcp", "flexion_all", "figure_eight"}
CALIBRATION = {
    "one finger": FLEXIONS,
    "thumb and index": FLEXIONS | {"thumb_flat", "flexion_thumb_ip"},
    "hand and forearm": set(),
}


def wizard(state: State) -> Wizard:
    protocols, steps = tuple(PROTOCOLS.values()), tuple(STEPS.values())
    return replace(Wizard(protocols, 3.0, steps, load_free()), state=state)


def names(protocols: list[Protocol]) -> set[str]:
    return {p.name for p in protocols}


@pytest.mark.parametrize("glove", GLOVES)
def test_a_small_glove_is_offered_the_tasks_and_steps_that_it_measures(glove: str) -> None:
    status = replace(READY, measured=frozenset(GLOVES[glove]))
    w = wizard(State.TASKS)
    assert names(w.offered(status)) == TASKS[glove]
    assert names(w.steps_offered(status)) == CALIBRATION[glove]
    has_finger = bool(CALIBRATION[glove])
    for action in (Action.CALIBRATE, Action.FREE):
        assert (action in w.allowed(status)) == has_finger
    assert (Action.CHECK in wizard(State.CONNECT).allowed(status)) == (glove == "thumb and index")
    assert Action.CONTINUE in wizard(State.CONNECT).allowed(status)


@pytest.mark.parametrize("glove", GLOVES)
def test_the_table_of_small_gloves_names_the_groups_that_are_offered(glove: str) -> None:
    status = replace(READY, measured=frozenset(GLOVES[glove]))
    row = re.search(rf"^\| {glove} \|.*$", TABLE.read_text(), re.MULTILINE)
    assert row is not None
    written = set(re.findall(r"`(\w+)`", row.group()))
    assert written == set(wizard(State.TASKS).groups(status)) - {"routine"}


@pytest.mark.parametrize("finger", FINGERS)
def test_the_live_curve_is_of_a_finger_that_is_measured(finger: str) -> None:
    measured = frozenset({"hand", *CHAINS[finger]})
    for task in ("rom_fist", "open_close", "rom_pip"):
        if PROTOCOLS[task].is_possible(measured):
            assert PROTOCOLS[task].curve_of(measured).startswith(f"{finger}_")
    assert PROTOCOLS["tremor_rest"].curve_of(measured) == "palm_turn"


def test_without_fingers_the_page_asks_for_the_wrist() -> None:
    status = replace(READY, measured=frozenset(GLOVES["hand and forearm"]))
    assert "wrist" in wizard_snapshot(wizard(State.CONNECT), status)["instruction"]
    assert "finger" in wizard_snapshot(wizard(State.CONNECT), READY)["instruction"]
