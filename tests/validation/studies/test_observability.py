"""Which movements tell what: what is simulated moves as its name says, and what is not told well enough is named."""

import numpy as np

from handscope.estimators.simulation.motion import COORDINATES
from handscope.validation.reproduce import Wanted
from handscope.validation.studies import observability
from handscope.validation.studies.observability import (
    FINGERS,
    GOOD,
    MOVEMENTS,
    Found,
    Trial,
    make_motion,
)


def extents(name: str, *coordinates: str) -> list[float]:
    """How far coordinates move in the middle of a movement, deg or cm."""
    x = make_motion(np.random.default_rng(0), MOVEMENTS[name], True).at(
        np.linspace(5.0, 15.0, 400)
    )[0]
    return [float(np.ptp(x[:, COORDINATES[c]])) for c in coordinates]


def test_only_what_the_name_says_moves() -> None:
    still = extents(
        "PIP alone, hand still",
        "index_mcp_flexion",
        "index_dip_flexion",
        "wrist_x",
        "forearm_pronation",
    )
    np.testing.assert_allclose(still, 0.0, atol=1e-6)
    assert extents("PIP alone, hand still", "index_pip_flexion")[0] > np.radians(80.0)
    assert min(
        extents("hand turns, finger stiff", "forearm_pronation", "forearm_flexion")
    ) > np.radians(30.0)
    np.testing.assert_allclose(
        extents("hand turns, finger stiff", "index_mcp_flexion", "wrist_y"), 0.0, atol=1e-6
    )


def test_what_a_movement_does_not_tell_is_named_and_drawn() -> None:
    sure = {name: 0.5 * good for name, (_, good) in GOOD.items()}
    unsure = sure | {"length, middle": 9.0}
    results = [
        (t, Found(True, unsure if t.movement == "hand turns, finger stiff" else sure, sure))
        for t in observability.trials(Wanted(seeds=1))
    ]
    assert results[0][0] == Trial("artificial finger", "MCP alone, hand still", 0)
    assert len(results) == len(FINGERS) * len(MOVEMENTS)
    told = observability.finding(Wanted(seeds=1), results)
    assert (
        "Human finger, hand turns, finger stiff: not told well enough: length, middle."
        in told.remarks
    )
    assert "Human finger, all joints, hand turns: everything is told." in told.remarks
    assert told.figures["reproduce-observability.svg"].count("hand turns, finger stiff") == 2
