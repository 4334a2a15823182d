"""The simulated person keeps time with the countdown that the cue tells."""

import numpy as np
import pytest

from handscope.app.devices.virtual_glove.firmware import Build, Firmware
from handscope.app.devices.virtual_glove.flash import factory_flash
from handscope.app.devices.virtual_glove.wearer import SimulatedPerson, layout
from handscope.app.protocols import load_steps
from handscope.estimators.alignment import functional_movements
from handscope.estimators.alignment.functional_movements import STEPS
from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import FORCE, GYR, Block
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.magnet.pipeline import hand_position
from handscope.estimators.methods import m2
from handscope.estimators.simulation.sensors import IDEAL
from handscope.sessions.wire.assembly import Assembler
from handscope.sessions.wire.framing import Encoder
from handscope.sessions.wire.messages import Cue, Format, Start

CUED, COUNTDOWN = 2.0, 3.0  # s


def test_a_movement_in_time_begins_when_the_countdown_is_over() -> None:
    streams = layout(("index",), 100.0)
    person = SimulatedPerson("left", sized("left"), streams, np.random.default_rng(0), IDEAL)
    index = next(s for s in streams if s.name == "index")
    person.samples(index, 0.0, CUED)
    assert person.cue("powerglove_01_index_mcp", {"lead": f"{COUNTDOWN:g}"}, CUED)
    block = person.samples(index, CUED, CUED + COUNTDOWN + 22.0)
    rate = np.linalg.norm(block.of(GYR)[:, 0], axis=1)
    t = block.t - CUED - COUNTDOWN
    assert rate[(t > -1.0) & (t < 0.0)].max() < 1e-6  # waiting
    bending = np.array([rate[(t > k) & (t < k + 1)].max() for k in range(20)])
    np.testing.assert_allclose(
        bending, np.radians(65.0) * 1.875, rtol=1e-3
    )  # minimum jerk over 1 s each way
    turning = [rate[np.argmin(np.abs(t - k))] for k in range(1, 21)]
    assert max(turning) < 1e-3  # at rest with every beat


@pytest.mark.parametrize("name", STEPS)
def test_a_step_of_a_functional_calibration_fills_the_time_that_the_wizard_gives_it(
    name: str,
) -> None:
    step = load_steps()[name]
    assert step.length
    streams = layout(FINGERS, 100.0)
    person = SimulatedPerson("left", sized("left"), streams, np.random.default_rng(1), IDEAL)
    late = 0.1  # s that a cue takes
    assert person.cue(name, {"lead": f"{step.countdown:g}", **step.cue_details}, CUED + late)
    blocks = [person.samples(s, CUED, CUED + COUNTDOWN + step.length + 0.3) for s in streams]
    onset = CUED + step.countdown
    piece = functional_movements.measure(m2.Params(), name, blocks, onset, onset + step.length, {})
    assert piece.problems == ()
    assert piece.quality.get("repetitions", 3) == 3


def test_a_trunk_and_a_magnet_tell_where_the_hand_reaches_through_the_wire() -> None:
    """The simulated arm goes 0.28 m forward and the trunk 4 cm after it; 1 s of the glove's samples are made at a time."""
    rng = np.random.default_rng(3)
    person = SimulatedPerson("left", sized("left"), layout(("trunk",), 100.0), rng, IDEAL)
    glove = Firmware(
        person,
        Build(format=Format.INT16),
        rng,
        factory_flash(person.streams, np.random.default_rng(4)),
    )
    assembler, blocks = Assembler(), list[Block]()
    encoder = Encoder()
    for sent in (Start(), Cue("reach", {})):
        blocks += assembler.feed(glove.handle(encoder.frame(sent)), 0.0)
    for k in range(100):
        blocks += assembler.feed(b"".join(glove.advance(0.1)), 0.1 * (k + 1))
    assert assembler.plate is not None and set(assembler.plate.places) == {
        f"trunk_mag_{n}" for n in (1, 2, 3, 4)
    }
    setting = hand_position.make_setting(
        hand_position.PlaceParams(),
        assembler.plate,
        list(assembler.streams.values()),
        assembler.mounting,
    )
    assert setting is not None
    places = hand_position.smooth_places(setting, whole_streams(blocks))
    forward, sd = places.place[:, 0], places.sd[:, 0]
    resting, reached = ((places.t > a) & (places.t < b) for a, b in ((6.0, 8.0), (4.0, 5.0)))
    assert np.median(forward[reached]) - np.median(forward[resting]) == pytest.approx(
        0.24, abs=0.02
    )
    assert (
        np.abs(np.ptp(forward) - 0.24) < 4 * sd.max() < 0.08
    )  # in the first swing, from which the magnetometers' lateness is learnt, it is least sure
    assert (places.flags[places.t > 2.0] == 0).mean() > 0.95


def test_force_sensors_feel_what_the_person_lifts_when_cued() -> None:
    streams = layout(("thumb", "index", "force"), 100.0)
    person = SimulatedPerson("left", sized("left"), streams, np.random.default_rng(0), IDEAL)
    force = streams[-1]
    before = person.samples(force, 0.0, CUED)
    assert person.cue("lift", {"lead": f"{COUNTDOWN:g}"}, CUED)
    blocks = [
        person.samples(force, CUED + k * 0.25, CUED + (k + 1) * 0.25) for k in range(48)
    ]  # as the glove asks
    t = np.concatenate([b.t for b in blocks]) - CUED - COUNTDOWN
    size = np.linalg.norm(
        np.concatenate([b.of(FORCE) for b in blocks]) - before.of(FORCE).mean(axis=0), axis=2
    )
    np.testing.assert_allclose(np.diff(t), 1 / 12, atol=1e-9)
    assert size[t < 0.5].max() < 0.4  # noise and drift
    held = (t > 3.0) & (t < 5.0)
    assert (size[held] > 1.5).all()
    assert size[(t > 8.0)].max() < 0.5
