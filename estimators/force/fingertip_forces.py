"""The forces of the fingertips in the global frame, at every instant of the hand's movement, from slow sensors in the fingertips' cuffs.

In      the trajectory of a method, the samples of force sensors (with how well they are calibrated) and of the inertial sensors on the same cuffs, the calibrations
Out     the trajectory with forces, of sensors with six axes also torques about the sensors' origins, their standard deviations and flags, and the
        specific force of what is held
Source  Kortier, thesis 6.2.2: (6.11), (6.13), (6.14); zero.py, interpolation.py, contact.py, tip_orientation.py
Limits  a cuff holds both sensors rigidly (6.2): the force sensor's mounting follows from the inertial sensor's, which is calibrated; a cuff that slips is not seen
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.options import option
from handscope.estimators.data.samples import ACC, FORCE, GYR, TORQUE, Block, exceeds
from handscope.estimators.data.trajectory import FORCE_WORDS, ForceFlag, Trajectory
from handscope.estimators.force import (
    accelerometer_error,
    contact,
    fingertip_torques,
    force_balance,
    interpolation,
    tip_orientation,
    zero,
)
from handscope.estimators.force.contact import ContactParams, Grasp
from handscope.estimators.force.sensor import is_repeated, is_stuck
from handscope.estimators.force.tip_orientation import TipParams, Tips
from handscope.estimators.force.zero import Zero, ZeroParams
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools

DEG = np.pi / 180
IMPOSSIBLE = 500.0  # N: no fingertip does that; ours, five times the strongest pinch
UNUSED = phrase("force.torques_without_forces")
LEAST = 8  # force samples of a sensor that is used
SETTLED, BEHIND = 0.3, 1.0  # s behind a grasp until fingers have let go, and then looked at
LOST = 1.0  # s without a force sample, beyond which a force counts as unknown


@dataclass(frozen=True, kw_only=True)
class ForceParams(TipParams, ContactParams, ZeroParams):
    """Options of the fingertip forces."""

    bridged: float = option(
        0.25,
        "s",
        "distance to the nearest force sample beyond which it counts as missing",
        "ours: three samples at 12 Hz",
        least=0.01,
    )
    doubt: float = option(
        4.0,
        "1",
        "standard deviations beyond which a zero has drifted, or forces do not balance",
        "ours",
        least=1.0,
    )
    torque_drift: float = option(
        1.5e-4,
        "Nm/sqrt(s)",
        "random walk of the zero of a torque",
        "ours: `drift` at a lever of 5 mm",
    )
    shared: float = option(
        2.0,
        "1",
        "standard deviations of the rest along the push beyond which another finger may carry part of the load",
        "ours",
        least=1.0,
    )


@dataclass(frozen=True)
class Sensor:
    """The force sensor of one fingertip: where it is read, and what surrounds it."""

    finger: str
    block: Block  # with this sensor alone

    @property
    def calibrated(self) -> bool:
        return bool(self.block.stream.scale_sd)


def attach_forces(
    params: ForceParams,
    trajectory: Trajectory,
    blocks: Sequence[Block],
    mounting: Mapping[str, Array],
    calibrations: Sequence[Calibration],
) -> tuple[Trajectory, list[str]]:
    """The trajectory with the forces of its fingertips, and warnings; unchanged where there are no force sensors."""
    sensors = _sensors(blocks)
    if not sensors or not len(trajectory):
        return trajectory, [
            phrase("force.fingers_flagged", fingers=", ".join(untold), what=UNUSED)
        ] if len(trajectory) and (untold := _torque_blocks(blocks)) else []
    fingers = [s.finger for s in sensors]
    rows = [FINGERS.index(f) for f in fingers]
    read = [_read(params, s.block, trajectory.t) for s in sensors]
    force, sd, zero_sd, flags = (
        np.stack([getattr(r, name) for r in read], axis=1)
        for name in ("force", "sd", "zero_sd", "flags")
    )
    scale = _scales(params, sensors)
    acc_error = accelerometer_error.error_sd_at_rest(params.acc_error, blocks)
    aligning = replace(
        params,
        force_scale=float(np.sqrt((scale**2).mean())),
        cuff_sd=_cuff_sd(params, sensors),
        acc_error=acc_error,
    )
    q_GF, acc, gyr = _cuff_states(
        trajectory, blocks, _apply_calibrated_axes(mounting, blocks), calibrations, fingers
    )
    cuffs = _Cuffs(trajectory.t, q_GF, force, acc, gyr, sd, scale)
    found = contact.find_grasps(
        params, trajectory.t, np.linalg.norm(force, axis=2), contact.thumb_column(fingers)
    )
    unknown = (aligning.tip_sd**2 + aligning.cuff_sd**2) * DEG**2
    corrections = _Corrections(
        np.zeros(force.shape),
        np.zeros(force.shape),
        np.tile(np.eye(3) * unknown, (*force.shape[:2], 1, 1)),
    )
    for grasp, following in zip(found, [*found[1:], None]):
        a, b = np.searchsorted(trajectory.t, [grasp.onset, grasp.end])
        flags[a:b, _find_unreleased(params, sensors, read, trajectory.t, grasp, following)] |= (
            np.uint8(ForceFlag.DRIFT)
        )
        _correct_within_grasp(params, aligning, cuffs, grasp, corrections, flags)
    q, q_inertial = (
        quat.multiply(quat.exp(by), q_GF) for by in (corrections.turn, corrections.inertial)
    )
    flags[~cuffs.known] |= np.uint8(ForceFlag.UNORIENTED)
    own, in_global = quat.rotate(q_inertial, acc), quat.rotate(q, force)
    common_sd, total = (
        _force_sd(in_global, own_sd, scale, corrections.covariance) for own_sd in (zero_sd, sd)
    )
    spread = _FingerColumns(len(trajectory), rows)
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(own).all(axis=2, keepdims=True)
        lifting = np.where(seen, own, 0.0).sum(axis=1) / seen.sum(axis=1)
    felt = replace(
        trajectory,
        forces=spread.over_fingers(in_global),
        forces_sd=spread.over_fingers(total),
        forces_common_sd=spread.over_fingers(common_sd),
        force_flags=spread.over_fingers(flags, 0),
        force_scale_sd=spread.over_fingers(np.tile(scale, (len(trajectory), 1)))
        if any(s.calibrated for s in sensors)
        else None,
        lifting=lifting,
    )
    twisted, doubts = _with_torques(
        params, felt, spread, blocks, sensors, read, q, corrections.covariance
    )
    return twisted, [*_describe_doubts(fingers, flags, trajectory.t, found), *doubts]


@dataclass(frozen=True)
class _Cuffs:
    """Forces of S sensors and the states of their cuffs at n instants, in the force sensors' frames."""

    t: Array  # (n,) s
    q_GF: Array  # (n, S, 4)
    force: Array  # (n, S, 3) N
    acc: Array  # (n, S, 3) m/s^2, specific force
    gyr: Array  # (n, S, 3) rad/s
    sd: Array  # (n, S) N, of the force in each axis
    scale: Array  # (S,) standard deviation of the scale

    @cached_property
    def known(self) -> Bools:
        """Where the orientation is known (n, S)."""
        return np.asarray(np.isfinite(self.q_GF).all(axis=2))


@dataclass(frozen=True)
class _Corrections:
    """Corrections of the cuffs' orientations, filled grasp by grasp."""

    turn: Array  # (n, S, 3) rad, of the force sensor in the global frame
    inertial: Array  # (n, S, 3) rad, of the inertial sensor
    covariance: Array  # (n, S, 3, 3) rad^2, of the force sensor's orientation


def _correct_within_grasp(
    params: ForceParams,
    aligning: ForceParams,
    cuffs: _Cuffs,
    grasp: Grasp,
    corrections: _Corrections,
    flags: NDArray[Any],
) -> None:
    """Fill the corrections by the balance of forces in a grasp; flag forces (n, S) that do not balance, or that a finger without a sensor may share."""
    a, b = np.searchsorted(cuffs.t, [grasp.onset, grasp.end])
    here = np.flatnonzero(cuffs.known[a:b].all(axis=0))
    if b - a <= 3 or len(here) < 2:
        return
    q_GF, force, acc, gyr = (v[a:b, here] for v in (cuffs.q_GF, cuffs.force, cuffs.acc, cuffs.gyr))
    found = tip_orientation.correct_orientations(
        aligning, Tips(cuffs.t[a:b], q_GF, force, acc, gyr)
    )
    for j, s in enumerate(here):
        corrections.turn[a:b, s], corrections.inertial[a:b, s] = (
            found.turn[:, j],
            found.inertial[:, j],
        )
        corrections.covariance[a:b, s] = found.covariance[:, 3 * j : 3 * j + 3, 3 * j : 3 * j + 3]
    if np.nanmedian(found.unbalanced) > params.doubt:
        flags[a:b, here] |= np.uint8(ForceFlag.UNBALANCED)
    pushed, specific = (
        quat.rotate(quat.multiply(quat.exp(by), q_GF), v)
        for by, v in ((found.turn, force), (found.inertial, acc))
    )
    rest, rest_sd = force_balance.residual_along_push(
        pushed, specific, found.covariance, cuffs.sd[a:b, here], cuffs.scale[here]
    )
    if abs(rest) > params.shared * rest_sd:
        flags[a:b, here] |= np.uint8(ForceFlag.SHARED)


def _force_sd(force: Array, sd: Array, scale: Array, covariance: Array) -> Array:
    """Standard deviation (n, S, 3) N of forces in the global frame: from that of a reading (n, S), of the scale (S,) and of the orientation (n, S, 3, 3)."""
    skew = quat.skew(force)
    turned = np.einsum("nsij,nsjk,nsik->nsi", skew, covariance, skew)
    return np.asarray(np.sqrt(sd[..., None] ** 2 + (scale[:, None] * force) ** 2 + turned))


def estimate_zeros(params: ForceParams, blocks: Sequence[Block]) -> dict[str, Array]:
    """Zero (3,) N of each finger's sensor at its newest sample, in the sensor's frame."""
    found = {}
    for sensor in _sensors(blocks):
        *_, nothing = _subtract_zero(params, sensor.block)
        found[sensor.finger] = nothing.level[-1, 0]
    return found


def newest_forces(
    zeros: Mapping[str, Array],
    trajectory: Trajectory,
    blocks: Sequence[Block],
    mounting: Mapping[str, Array],
    calibrations: Sequence[Calibration],
) -> Array:
    """Forces (5, 3) N of the newest samples in the global frame, with the orientations of the trajectory's last row; NaN where not known.

    For display: at once, without the corrections of the tips' orientations by a grasp.
    """
    fingers, global_forces = list(zeros), np.full((len(FINGERS), 3), np.nan)
    q_GF, _, _ = _cuff_states(
        trajectory.between(trajectory.t[-1], np.inf),
        (),
        _apply_calibrated_axes(mounting, blocks),
        calibrations,
        fingers,
    )
    for block in blocks:
        for k, point in enumerate(block.stream.sensors if FORCE in block.stream.quantities else ()):
            if (finger := point.removesuffix("_tip_force")) in zeros:
                force = block.of(FORCE)[-1, k] - zeros[finger]
                if np.isfinite(force).all():  # infinite: a raw channel at its limit
                    global_forces[FINGERS.index(finger)] = quat.rotate(
                        q_GF[0, fingers.index(finger)], force
                    )
    return global_forces


@dataclass(frozen=True)
class _FingerColumns:
    """From the fingers with a sensor to all five."""

    n: int
    rows: Sequence[int]

    def over_fingers(self, values: NDArray[Any], fill: float = np.nan) -> NDArray[Any]:
        """(n, S, ...) -> (n, 5, ...)"""
        whole = np.full((self.n, len(FINGERS), *values.shape[2:]), fill, values.dtype)
        whole[:, self.rows] = values
        return whole


def _with_torques(
    params: ForceParams,
    felt: Trajectory,
    spread: _FingerColumns,
    blocks: Sequence[Block],
    sensors: Sequence[Sensor],
    read: "list[_SensorForce]",
    q_GF: Array,
    covariance: Array,
) -> tuple[Trajectory, list[str]]:
    """The trajectory with the torques of sensors with six axes, and warnings; unchanged where there are none."""
    torque_blocks, doubts = _torque_blocks(blocks), []
    values, sd = (
        np.full((len(felt), len(sensors), 3), np.nan),
        np.full((len(felt), len(sensors)), np.nan),
    )
    for s, sensor in enumerate(sensors):
        if (block := torque_blocks.pop(sensor.finger, None)) is not None:
            if fingertip_torques.is_impossible(block):
                doubts.append(
                    phrase(
                        "force.fingers_flagged",
                        fingers=sensor.finger,
                        what=phrase("force.impossible_torques"),
                    )
                )
            raw = block.of(TORQUE)[:, 0]
            limited = block.at_limit(TORQUE)[:, 0] | is_stuck(raw / fingertip_torques.LEVER)
            torque = fingertip_torques.read_torques(
                block, limited, params.torque_drift, sensor.block.t, read[s].free, felt.t
            )
            if torque is not None:
                values[:, s], sd[:, s] = (
                    np.where(
                        _is_near_limited(block.t, limited, felt.t)[:, None], np.nan, torque.values
                    ),
                    torque.sd,
                )
    if torque_blocks:
        doubts.append(
            phrase("force.fingers_flagged", fingers=", ".join(torque_blocks), what=UNUSED)
        )
    if not np.isfinite(values).any():
        return felt, doubts
    in_global = quat.rotate(q_GF, values)
    skew = quat.skew(in_global)
    turned = np.einsum("nsij,nsjk,nsik->nsi", skew, covariance, skew)
    total = np.sqrt(
        sd[..., None] ** 2 + (_scales(params, sensors)[:, None] * in_global) ** 2 + turned
    )
    return replace(
        felt, torques=spread.over_fingers(in_global), torques_sd=spread.over_fingers(total)
    ), doubts


def _torque_blocks(blocks: Sequence[Block]) -> dict[str, Block]:
    """By finger the samples of its sensor's torques, in the order of the hand; of two streams with one finger's the longer."""
    found: dict[str, Block] = {}
    for block in blocks:
        if TORQUE in block.stream.quantities:
            for k, point in enumerate(block.stream.sensors):
                own, finger = _select_sensor(block, k), point.removesuffix("_tip_force")
                if (
                    finger in FINGERS
                    and np.isfinite(own.of(TORQUE)).any()
                    and (finger not in found or len(found[finger].t) < len(own.t))
                ):
                    found[finger] = own
    return {f: found[f] for f in FINGERS if f in found}


def _select_sensor(block: Block, k: int) -> Block:
    """The block with its k-th sensor alone."""
    point = block.stream.sensors[k]
    scale, turn = (
        {point: declared[point]} if point in declared else {}
        for declared in (block.stream.scale_sd, block.stream.turn_sd)
    )
    return replace(
        block,
        stream=replace(block.stream, sensors=(point,), scale_sd=scale, turn_sd=turn),
        values=block.values[:, k : k + 1],
    )


def _scales(params: ForceParams, sensors: Sequence[Sensor]) -> Array:
    """Standard deviation (S,) of each sensor's scale, the same in all samples: that of its calibration, or the default."""
    return np.array(
        [next(iter(s.block.stream.scale_sd.values()), params.force_scale) for s in sensors]
    )


def _cuff_sd(params: ForceParams, sensors: Sequence[Sensor]) -> float:
    """Turn, deg, of the force sensors against the inertial sensors on their cuffs: of those whose calibration has it, and of the others together."""
    each = [
        np.degrees(next(iter(s.block.stream.turn_sd.values()), params.cuff_sd * DEG))
        for s in sensors
    ]
    return float(np.sqrt(np.mean(np.square(each))))


@dataclass(frozen=True)
class _SensorForce:
    force: Array  # (n, 3) N, without the zero
    sd: Array  # (n,)
    zero_sd: Array  # (n,) of it that of the zero
    flags: NDArray[np.uint8]  # (n,)
    free: Bools  # (samples of the sensor,) where it touches nothing


def _sensors(blocks: Sequence[Block]) -> list[Sensor]:
    """The fingers' force sensors, in the order of the hand; of two streams with one finger's the longer."""
    found: dict[str, Sensor] = {}
    for block in blocks:
        if FORCE in block.stream.quantities:
            for k, point in enumerate(block.stream.sensors):
                own, finger = _select_sensor(block, k), point.removesuffix("_tip_force")
                longer = finger not in found or len(found[finger].block.t) < len(block.t)
                if (
                    finger in FINGERS
                    and longer
                    and np.isfinite(own.of(FORCE)).all(axis=(1, 2)).sum() >= LEAST
                ):
                    found[finger] = Sensor(finger, own)
    return [found[f] for f in FINGERS if f in found]


def _read(params: ForceParams, block: Block, at: Array) -> _SensorForce:
    """One sensor's force at the instants of the trajectory."""
    values, limited, noise, nothing = _subtract_zero(params, block)
    interpolated = interpolation.interpolate(block.t, values - nothing.level, noise, at)
    near = np.clip(np.searchsorted(block.t, at), 0, len(block.t) - 1)
    flags = np.zeros(len(at), np.uint8)
    flags[interpolated.distance[:, 0] > params.bridged] |= np.uint8(ForceFlag.MISSING)
    flags[_is_near_limited(block.t, limited, at)] |= np.uint8(ForceFlag.SATURATED)
    flags[nothing.jump[near, 0] > params.doubt] |= np.uint8(ForceFlag.DRIFT)
    lost = interpolated.distance[:, 0] > LOST
    force = np.where(lost[:, None], np.nan, interpolated.values[:, 0])
    zero_sd = nothing.sd[near, 0]
    return _SensorForce(
        force, np.hypot(interpolated.sd[:, 0], zero_sd), zero_sd, flags, nothing.free[:, 0]
    )


def _subtract_zero(params: ForceParams, block: Block) -> tuple[Array, Bools, Array, Zero]:
    """Readings (n, 1, 3) of one sensor without its zero and without limited and repeated ones; which are limited (n,), the noise of a reading, and the zero."""
    raw = block.of(FORCE)
    limited = block.at_limit(FORCE)[:, 0] | is_stuck(raw[:, 0]) | exceeds(raw[:, 0], IMPOSSIBLE)
    values = np.where(limited[:, None, None], np.nan, raw)
    noise = interpolation.reading_noise(block.t, values)
    nothing = zero.estimate_zero(params, block.t, values, noise)
    repeats = (
        is_repeated(raw[:, 0])
        & ~limited
        & (np.linalg.norm((raw - nothing.level)[:, 0], axis=1) > params.grasp)
    )
    return np.where(repeats[:, None, None], np.nan, values), limited, noise, nothing


def _is_near_limited(t: Array, limited: Bools, at: Array) -> Bools:
    """Which instants lie between samples of which one is limited."""
    if not limited.any() or len(t) < 2:
        return np.zeros(len(at), bool)
    k = np.clip(np.searchsorted(t, at, side="right"), 1, len(t) - 1)
    return np.asarray(limited[k] | limited[k - 1])


def _find_unreleased(
    params: ForceParams,
    sensors: Sequence[Sensor],
    read: Sequence[_SensorForce],
    at: Array,
    grasp: Grasp,
    following: Grasp | None,
) -> Bools:
    """Which sensors (S,) read a significant force after a grasp while another reads none: their zero jumped during the grasp."""
    start, stop = grasp.end + SETTLED, grasp.end + SETTLED + BEHIND
    behind = [r.free[(s.block.t > start) & (s.block.t < stop)] for s, r in zip(sensors, read)]
    if (
        (following and following.onset < stop)
        or at[-1] < stop
        or min(len(free) for free in behind) < LEAST
    ):
        return np.zeros(len(sensors), bool)
    shares, rows = np.array([free.mean() for free in behind]), (at > start) & (at < stop)
    left = [
        np.linalg.norm(np.median(r.force[rows], axis=0)) / np.sqrt(3.0) / np.median(r.sd[rows])
        for r in read
    ]
    return np.asarray((shares == 0) & (shares.max() > 0.5) & (np.array(left) > params.doubt))


def _apply_calibrated_axes(
    mounting: Mapping[str, Array], blocks: Sequence[Block]
) -> dict[str, Array]:
    """The mountings; a force sensor that was calibrated in the axes of its cuff's inertial sensor gets that sensor's mounting."""
    points = [point for block in blocks for point in block.stream.turn_sd]
    return {
        **mounting,
        **{
            p: mounting.get(CHAINS[p.removesuffix("_tip_force")][-1], quat.IDENTITY) for p in points
        },
    }


def _cuff_states(
    trajectory: Trajectory,
    blocks: Sequence[Block],
    mounting: Mapping[str, Array],
    calibrations: Sequence[Calibration],
    fingers: Sequence[str],
) -> tuple[Array, Array, Array]:
    """Every cuff's orientation (n, S, 4), specific force and angular rate (n, S, 3) in the force sensor's frame."""
    n, S = len(trajectory), len(fingers)
    q_GF, acc, gyr = np.empty((n, S, 4)), np.full((n, S, 3), np.nan), np.full((n, S, 3), np.nan)
    for s, finger in enumerate(fingers):
        segment = CHAINS[finger][-1]
        nominal = mounting.get(segment, quat.IDENTITY)
        q_IF = quat.multiply(
            quat.conjugate(nominal), mounting.get(f"{finger}_tip_force", quat.IDENTITY)
        )
        q_BI = _mounting_over_time(trajectory.t, segment, nominal, calibrations)
        q_GF[:, s] = quat.multiply(trajectory.q_GS[:, SEGMENT[segment]], quat.multiply(q_BI, q_IF))
        for block in blocks:
            if block.stream.inertial and segment in block.stream.sensors and len(block.t) > 1:
                k = block.stream.sensors.index(segment)
                for out, quantity in ((acc, ACC), (gyr, GYR)):
                    out[:, s] = quat.rotate(
                        quat.conjugate(q_IF),
                        _interpolate(block.t, block.of(quantity)[:, k], trajectory.t),
                    )
    return q_GF, acc, gyr


def _mounting_over_time(
    t: Array, segment: str, nominal: Array, calibrations: Sequence[Calibration]
) -> Array:
    """Alignment (n, 4) of the inertial sensor on its segment, by the calibration that holds at the time."""
    q_BI = np.tile(
        calibrations[0].q_BS.get(segment, nominal) if calibrations else nominal, (len(t), 1)
    )
    for c in calibrations[1:]:
        q_BI[t >= c.t] = c.q_BS.get(segment, nominal)
    return q_BI


def _interpolate(t: Array, values: Array, at: Array) -> Array:
    """Vectors (n, 3) by linear interpolation; NaN outside and beside missing samples."""
    return np.stack([np.interp(at, t, v, left=np.nan, right=np.nan) for v in values.T], axis=1)


def _describe_doubts(
    fingers: Sequence[str], flags: NDArray[np.uint8], t: Array, found: list[Grasp]
) -> list[str]:
    """One sentence for each kind of doubt within the grasps."""
    held = contact.is_inside(t, found)
    sentences = []
    for flag, words in FORCE_WORDS.items():
        concerned = [
            f for s, f in enumerate(fingers) if held.any() and ((flags[held, s] & flag) != 0).any()
        ]
        if concerned:
            sentences.append(
                phrase("force.fingers_flagged", fingers=", ".join(concerned), what=words)
            )
    return sentences
