"""The hand from the orientations of its sensors: the pipeline that B, M1 and M2 share
(estimators/methods/b.py, m1.py, m2.py).

In      inertial and magnetic blocks of any subset of sensors (the hand's is needed), or blocks of
        orientations (orientation/given_orientations.py), a Calibration
Out     Trajectory: joint angles, segment orientations, fingertips in the wrist frame
Source  Salchow-Hoemmen 2019, 2.4: (17), (18), (19)-(22), (23)-(27)
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from handscope.estimators.alignment import functional_movements
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.options import option
from handscope.estimators.data.samples import ORIENTATION, Block, Stream
from handscope.estimators.data.trajectory import Flag, Trajectory, empty, join
from handscope.estimators.hand import pose as hand_pose
from handscope.estimators.hand.anatomy import IS_DOF, JOINTS, SEGMENT, SEGMENTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation import fusion as orientation_fusion
from handscope.estimators.orientation import given_orientations, heading_constraints, resampling
from handscope.estimators.sensors import magnetometer_resampling

UNSURE = np.uint8(Flag.MISSING | Flag.SATURATED)  # samples that tell no heading


@dataclass(frozen=True, kw_only=True)
class Params(
    given_orientations.GivenParams,
    orientation_fusion.FusionParams,
    functional_movements.FunctionalParams,
    heading_constraints.HeadingParams,
):
    """Options that B, M1 and M2 share."""

    MAGNETOMETER: ClassVar[bool] = False  # whether headings come from magnetometers
    constraints: bool = option(
        True,
        "",
        "zero the angles that are no freedom of their joint and clip the rest to the permitted range",
        "Salchow-Hoemmen 2019, 2.4.3",
    )


@dataclass(frozen=True)
class State:
    """Everything the next step needs: save it, copy it, start again from it."""

    calibration: Calibration
    q_SB: Array  # (segments, 4) segment-to-sensor rotations, identity where not measured
    sensors: Mapping[str, resampling.SensorsState]  # by stream
    rows: resampling.State
    magnetic: magnetometer_resampling.State | None = None  # None: headings come from the pose alone
    headings: heading_constraints.State | None = None  # None: nothing corrects them


def start(params: Params, calibration: Calibration, streams: tuple[Stream, ...]) -> State:
    """Begin at the calibration's moment."""
    q_SB = np.tile(quat.IDENTITY, (len(SEGMENTS), 1))
    for name, q_BS in calibration.q_BS.items():
        q_SB[SEGMENT[name]] = quat.conjugate(q_BS)
    inertial = [s for s in streams if s.inertial]
    raw = tuple(s for s in streams if not _is_given(s))
    magnetic = magnetometer_resampling.start(raw) if params.MAGNETOMETER else None
    used = [
        magnetometer_resampling.joined_stream(s) if params.MAGNETOMETER and not _is_given(s) else s
        for s in inertial
    ]
    sensors = {s.name: _sensors(params, calibration, s) for s in used}
    corrected = params.heading_correction and not params.MAGNETOMETER
    return State(
        calibration,
        q_SB,
        sensors,
        resampling.start(used),
        magnetic,
        heading_constraints.start(calibration.q_BS_sd) if corrected else None,
    )


def step(params: Params, state: State, *blocks: Block) -> tuple[State, Trajectory]:
    """Advance by blocks of any length, 0 included, of any streams; those of streams that the method
    does not use change nothing."""
    if state.magnetic is None:
        return _fuse(params, state, [b for b in blocks if b.stream.inertial])
    raw = (b for b in blocks if not _is_given(b.stream))
    magnetic, complete = magnetometer_resampling.step(state.magnetic, *raw)
    given = (b for b in blocks if _is_given(b.stream) and b.stream.inertial)
    return _fuse(params, replace(state, magnetic=magnetic), [*given, *complete])


def release(params: Params, state: State, patience: float) -> tuple[State, Trajectory]:
    """For a live view: give out what is older than `patience` s without waiting for a strip or
    magnetometer that is silent."""
    pieces = []
    if state.magnetic is not None:
        magnetic, blocks = magnetometer_resampling.release(state.magnetic, patience)
        state, piece = _fuse(params, replace(state, magnetic=magnetic), blocks)
        pieces.append(piece)
    rows, given = resampling.release(state.rows, patience)
    state, piece = _hand(params, replace(state, rows=rows), given)
    return state, join([*pieces, piece], state.calibration.hand)


def finish(params: Params, state: State) -> tuple[State, Trajectory]:
    """Give out what was held back: nothing more will come."""
    pieces = []
    if state.magnetic is not None:
        magnetic, blocks = magnetometer_resampling.release(state.magnetic, -np.inf)
        state, piece = _fuse(params, replace(state, magnetic=magnetic), blocks)
        pieces.append(piece)
    sensors, rows, given = resampling.drain(params, state.sensors, state.rows)
    state, piece = _hand(params, replace(state, sensors=sensors, rows=rows), given)
    return state, join([*pieces, piece], state.calibration.hand)


def _fuse(params: Params, state: State, blocks: list[Block]) -> tuple[State, Trajectory]:
    """Orientations of the blocks' sensors, and the hand at every instant that is complete."""
    sensors, fused = dict(state.sensors), []
    for k, block in enumerate(blocks):
        fusion = sensors.get(block.stream.name)
        if (
            fusion is None or fusion.stream != block.stream
        ):  # plugged in later, or with another rate or other sensors than before
            if k:  # first what the blocks before it complete
                state, early = _fuse(params, state, blocks[:k])
                state, late = _fuse(params, state, blocks[k:])
                return state, join([early, late], state.calibration.hand)
            fusion = _sensors(params, state.calibration, block.stream)
        if isinstance(fusion, given_orientations.State):
            fusion, oriented = given_orientations.step(params.max_gap, fusion, block)
        else:
            fusion, oriented = orientation_fusion.step(params, fusion, block)
        sensors[block.stream.name] = fusion
        fused.append((block.stream, oriented))
    rows, given = resampling.step(state.rows, *fused)
    return _hand(params, replace(state, sensors=sensors, rows=rows), given)


def _is_given(stream: Stream) -> bool:
    """Whether the device fused the stream's samples itself."""
    return ORIENTATION in stream.quantities


def _sensors(params: Params, calibration: Calibration, stream: Stream) -> resampling.SensorsState:
    if _is_given(stream):
        return given_orientations.start(
            stream, calibration, params.MAGNETOMETER, calibration.rates.get(stream.name)
        )
    north = calibration.north if params.MAGNETOMETER else {}
    rate = calibration.rates.get(stream.name)
    return orientation_fusion.start(
        stream, calibration.q_GS, calibration.gyr_bias, calibration.end, north, rate
    )


def _hand(params: Params, state: State, rows: resampling.Rows) -> tuple[State, Trajectory]:
    """Pose of the hand from the sensors' orientations."""
    if not len(rows.t):
        return state, empty(state.calibration.hand)
    q_GB, flags = quat.multiply(rows.q_GS, state.q_SB), rows.flags
    if state.headings is not None:
        headings, q_GB, lost = heading_constraints.step(
            params, state.headings, rows.t, q_GB, rows.rotation_variance, (rows.flags & UNSURE) == 0
        )
        state, flags = (
            replace(state, headings=headings),
            (flags & ~np.uint8(Flag.HEADING_LOST)) | np.uint8(Flag.HEADING_LOST) * lost,
        )
    pose = hand_pose.pose_hand(
        hand_pose.joint_rotations(q_GB), q_GB, state.calibration.geometry, params.constraints
    )
    q_GS = pose.q_GS if params.constraints else q_GB
    q_GS[:, SEGMENT["forearm"]] = q_GB[:, SEGMENT["forearm"]]
    return state, Trajectory(
        state.calibration.hand,
        rows.t,
        pose.freedoms,
        q_GS,
        pose.tips,
        flags,
        _angles_sd(state.calibration, pose.freedoms),
    )


def _angles_sd(calibration: Calibration, angles: Array) -> Array | None:
    """Standard deviations (n, joints, 3) rad of angles between two orientations that a device gave;
    NaN where another sensor is one of the two, None where nothing says how good they are."""
    if calibration.orientation_sd is None:
        return None
    given = [j.parent in calibration.q_ES and j.child in calibration.q_ES for j in JOINTS]
    sd = np.where(given, np.sqrt(2.0) * calibration.orientation_sd, np.nan)[:, None]
    return np.where(IS_DOF & np.isfinite(angles), sd, np.nan)
