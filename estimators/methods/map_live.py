"""MAP-LIVE: an experiment; each finger as in `map`, in a window that slides along while the
hand moves.

In      inertial blocks of the hand and of fingers of which at least the first phalanx has a sensor,
        a Calibration from the initial pose
Out     Trajectory, `lag` and up to 0.2 s behind the newest sample: fingers as their windows have
        them, all else as `ekf` has it, with standard deviations
Source  Kortier, thesis ch. 4, and its outlook (fixed lag);
        estimators/self_calibration/sliding_window/estimator.py
Limits  fingers one by one; a finger of which a sensor was silent for long, or whose readings fit no
        hand, is as `ekf` has it until a window has begun again. How it does beside `ekf`:
        docs/decisions/0007-map-live.md
"""

from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.options import option, part_of
from handscope.estimators.data.samples import Block, Stream
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand import pose as hand_pose
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, JOINT, SEGMENT
from handscope.estimators.hand.geometry import with_finger_lengths
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.methods import ekf
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.method import Capabilities
from handscope.estimators.self_calibration.problem import Noise
from handscope.estimators.self_calibration.sliding_window import limb as sliding_window_limb
from handscope.estimators.self_calibration.sliding_window import streaming_samples
from handscope.estimators.self_calibration.sliding_window.limb import Finger, Setting

TITLE = phrase("method_title.map_live")
CAPABILITIES = Capabilities(needs_pose=True, gives_covariance=True, couples_chains=True)
NODES, LEAST = 20, 3  # that a window takes at a time: 0.2 s; that it begins with
LOST_SD = np.radians(60.0)  # of a heading that was lost
UNPOSED = 1.0  # rad: without a pose no joint is known to have been straight
DECISION = "ours: docs/decisions/0007-map-live.md"


@dataclass(frozen=True, kw_only=True)
class Params(ekf.Params, Noise):
    """Options of MAP-LIVE."""

    window: float = option(0.6, "s", "length of the window", DECISION, least=0.6, most=5.0)
    lag: float = option(
        0.1,
        "s",
        "how far behind the newest sample of the window the hand is given out",
        DECISION,
        most=0.3,
    )
    length: float = option(
        2.0,
        "mm",
        "how far the given lengths of segments may be off",
        "Salchow-Hoemmen 2019, 5: ratios vary by a few percents; size ours. The pose tells nothing of them, unlike 40 s of map",
        least=1e-3,
    )
    straight: float = option(
        2.0,
        "deg",
        "how far each joint may be off what it should be in the initial pose",
        "ours: people miss it by up to 2.5 deg",
        least=0.1,
    )


@dataclass(frozen=True)
class State:
    """Everything the next step needs: save it, copy it, start again from it."""

    filter: ekf.State
    rows: Trajectory  # as ekf has them, not given out yet
    reached: float  # s, its newest row
    readings: streaming_samples.State
    fingers: tuple[Finger, ...]


def start(params: Params, calibration: Calibration, streams: tuple[Stream, ...]) -> State:
    """Begin at the calibration's moment."""
    begun = ekf.start(params, calibration, streams)
    worn = {name for s in streams if s.inertial for name in s.sensors}
    fingers = [sliding_window_limb.build_finger(f, worn) for f in FINGERS]
    reference = next(s for s in streams if s.name == begun.rows.reference)
    rows = trajectory.empty(calibration.hand)
    return State(
        begun,
        rows,
        -np.inf,
        streaming_samples.start(reference),
        tuple(f for f in fingers if f is not None),
    )


def step(params: Params, state: State, *blocks: Block) -> tuple[State, Trajectory]:
    """Advance by blocks of any length, 0 included, of any streams; those of streams that the method
    does not use change nothing."""
    after, rows = ekf.step(params, state.filter, *blocks)
    readings = state.readings
    for block in blocks:
        readings = streaming_samples.store_block(readings, block)
    return _advance(params, replace(state, filter=after, readings=readings), rows)


def release(params: Params, state: State, patience: float) -> tuple[State, Trajectory]:
    """For a live view: give out what is older than `patience` s without waiting for a strip that is
    silent."""
    after, rows = ekf.release(params, state.filter, patience)
    return _advance(params, replace(state, filter=after), rows)


def finish(params: Params, state: State) -> tuple[State, Trajectory]:
    """Give out what was held back: nothing more will come."""
    after, rows = ekf.finish(params, state.filter)
    state, given = _advance(params, replace(state, filter=after), rows)
    left = streaming_samples.count_ready(state.readings, state.reached)
    if left >= LEAST:
        state = _nodes(params, state, left)
    last = _give_out(params, state, state.rows)
    return replace(state, rows=trajectory.empty(state.rows.hand)), trajectory.join(
        [given, last], state.rows.hand
    )


def _advance(params: Params, state: State, rows: Trajectory) -> tuple[State, Trajectory]:
    """Take what the filter made of new samples; windows go on as soon as there are nodes enough."""
    hand, given = state.rows.hand, []
    if not np.isfinite(
        state.readings.begin
    ):  # the stream that sets the pace is silent: there are no nodes
        return state, rows
    if len(rows):
        state = replace(
            state, rows=trajectory.join([state.rows, rows], hand), reached=float(rows.t[-1])
        )
    while streaming_samples.count_ready((state := _resume(state)).readings, state.reached) >= NODES:
        state = _nodes(params, state, NODES)
        newest = state.readings.taken - 2
        known = float(state.readings.instants(newest, newest + 1)[0]) - params.lag
        given.append(_give_out(params, state, state.rows.between(-np.inf, known)))
        state = replace(state, rows=state.rows.between(known, np.inf))
    return state, trajectory.join(given, hand)


def _resume(state: State) -> State:
    """Where nothing came for long, windows begin again behind it."""
    readings = (
        streaming_samples.resume(state.readings, float(state.rows.t[0]))
        if len(state.rows)
        else state.readings
    )
    if readings is state.readings:
        return state
    return replace(
        state,
        readings=readings,
        fingers=tuple(sliding_window_limb.close_window(f) for f in state.fingers),
    )


def _nodes(params: Params, state: State, count: int) -> State:
    """All fingers with so many nodes more."""
    readings, nodes = streaming_samples.take_nodes(state.readings, count, params.max_gap)
    dt = readings.period * readings.each
    calibration, lag = state.filter.calibration, round(params.lag / dt)
    setting = Setting(
        part_of(params, Noise),
        calibration,
        max(round(params.window / dt), lag + NODES + 2),
        lag,
        np.radians(params.straight) if calibration.source.is_pose else UNPOSED,
        params.length_sd,
    )
    k = min(int(np.searchsorted(state.rows.t, nodes.t[0])), len(state.rows) - 1)
    q_GS = quat.multiply(state.rows.q_GS[k], quat.conjugate(state.filter.q_SB))
    lost = (state.rows.flags[k] & np.uint8(Flag.HEADING_LOST)) > 0
    sd = np.asarray(np.where(lost, LOST_SD, np.radians(params.mounting)), float)
    fingers = tuple(
        sliding_window_limb.advance_finger(setting, f, nodes, q_GS, sd) for f in state.fingers
    )
    return replace(state, readings=readings, fingers=fingers)


def _give_out(params: Params, state: State, rows: Trajectory) -> Trajectory:
    """The filter's rows with the fingers as their windows have them; a finger that has none is as
    the filter has it, and as sure."""
    if not len(rows):
        return rows
    assert rows.angles_sd is not None and rows.tips_sd is not None
    q_GB, angles_sd, tips_sd = rows.q_GS.copy(), rows.angles_sd.copy(), rows.tips_sd.copy()
    geometry, node = state.filter.calibration.geometry, state.readings.period * state.readings.each
    for finger in state.fingers:
        if finger.on_hand is None or finger.lengths is None or finger.sure is None:
            continue
        own, n, last = (
            [*finger.on_hand],
            len(finger.on_hand[finger.chain.sensors[1]]),
            state.readings.taken - 1,
        )
        at = state.readings.instants(last - n, last)
        inside = np.flatnonzero(rows.t > at[0] - node)
        for name in own:
            on_hand = _between(rows.t[inside], at, finger.on_hand[name])
            q_GB[inside, SEGMENT[name]] = quat.multiply(q_GB[inside, SEGMENT["hand"]], on_hand)
        joints, k = np.array([JOINT[j] for j in finger.chain.joints]), FINGERS.index(finger.name)
        angles_sd[inside[:, None], joints] = finger.sure.angles[joints]
        geometry = with_finger_lengths(geometry, finger.name, finger.lengths)
        reach = geometry.palm_length + sum(geometry.lengths[s] for s in CHAINS[finger.name])
        wrist = np.nanmax(np.nan_to_num(angles_sd[inside, JOINT["wrist"]]), axis=1, keepdims=True)
        tips_sd[inside, k] = np.hypot(finger.sure.tip, wrist * reach)
    pose = hand_pose.pose_hand(hand_pose.joint_rotations(q_GB), q_GB, geometry, params.constraints)
    unknown, nowhere = np.isnan(pose.freedoms), np.isnan(pose.tips)
    return replace(
        rows,
        angles=pose.freedoms,
        q_GS=pose.q_GS,
        tips=pose.tips,
        angles_sd=np.where(unknown, np.nan, angles_sd),
        tips_sd=np.where(nowhere, np.nan, tips_sd),
    )


def _between(t: Array, known: Array, q: Array) -> Array:
    """Orientations (n, 4) at instants between those of `known`; outside them the nearest."""
    k = np.clip(np.searchsorted(known, t, side="right") - 1, 0, len(known) - 2)
    return quat.slerp(q[k], q[k + 1], np.clip((t - known[k]) / (known[k + 1] - known[k]), 0.0, 1.0))
