"""Calibration from one pose held still: gyroscope biases, sensor headings against the hand and, if
wanted, the whole sensor-to-segment rotation.

In      at least 3 s of samples with index..little straight, the thumb straight and either aligned
        with the fingers or at a known CMC angle
Out     Calibration: orientations of all sensors at the start of the pose, q_BS, biases, how still
        it was
Source  Salchow-Hoemmen 2019, 2.4.2 (`heading`); the whole relative orientation (`full`) goes beyond
        the paper
Limits  a pose that is not the one asked for becomes an offset of every angle; a slow turn about the
        vertical looks like a bias; of a misaligned sensor the part about the vertical cannot be
        seen
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from handscope.estimators.data.calibration import Calibration, CalibrationSource, SensorQuality
from handscope.estimators.data.options import option
from handscope.estimators.data.samples import ACC, GYR, MAG, Block, Event, Stream
from handscope.estimators.errors import InputError
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    DOF_NAMES,
    JOINT,
    JOINTS,
    LIMITS,
    SEGMENTS,
    Hand,
    Joint,
)
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.fusion import make_upright
from handscope.estimators.orientation.given_orientations import mean_orientations
from handscope.estimators.orientation.resampling import measure_rates
from handscope.estimators.sensors.missing_samples import is_complete

# of the rate: the oscillator of a sensor is good for 1 % (MPU-9250 specification, table 3)
RATE_DOUBT = 0.02
# pieces a second, whose means give the standard deviation of a mean: longer than a period of
# tremor
QUARTERS = 4
DIFFERENCES, LEAST_SAMPLES = 8, 60  # to estimate noise from
DEG = np.pi / 180
# rad that a pose's angle may lie beyond a joint's limits: stiff, lax and deformed joints do; ours
BEYOND_LIMITS = 30 * DEG
THERAPIST = "therapist"  # what an event says of a pose that the patient did not take alone


UNCALIBRATED = phrase("calibration.uncalibrated")


@dataclass(frozen=True, kw_only=True)
class PoseParams:
    """Options of the calibration from a pose; angles in deg, times in s."""

    alignment: str = option(
        "full",
        "",
        "what the pose fixes: each sensor's heading against the hand (the paper), its whole orientation (full), that against the inclination in which "
        "the sensors of hand and fingers agree (common: half the effect of a misaligned hand sensor, but a strip that is missing changes the others a little)",
        "heading: Salchow-Hoemmen 2019, 2.4.2; full, common: ours",
        ("full", "common", "heading"),
    )
    pose_duration: float = option(
        3.0,
        "s",
        "shortest pose; of a longer one the stillest such stretch counts",
        "Salchow-Hoemmen 2019, 2.4.2",
        least=0.5,
        most=60.0,
    )
    pose_rate: float = option(
        3.0,
        "deg/s",
        "largest wander of a sensor's one-second mean angular rate in a still pose",
        "ours: 1.5 times VQF's rest threshold",
    )
    pose_tilt: float = option(
        3.0,
        "deg",
        "largest change of gravity's direction in a sensor during a still pose",
        "ours: the angle that 1 s at 3 deg/s makes",
    )
    pose_bias: float = option(
        20.0,
        "deg/s",
        "largest mean rate that may be a gyroscope's bias",
        "LSM330DLC and MPU-9250 data sheets: zero-rate level 5-20 deg/s",
    )


@dataclass(frozen=True, kw_only=True)
class PoseErrorParams:
    """How exactly the pose is taken and seen, for methods that say how sure they are; angles in deg."""

    pose_sd: float = option(
        2.0,
        "deg",
        "what a person misses the initial pose by, each freedom of a joint that was not measured",
        "ours: how careful a person is is not known; any standard deviation from 1.5 to 2.5 deg counted as likely",
        least=1e-3,
    )
    angle_sd: float = option(
        0.3,
        "deg",
        "error of gravity's direction in a sensor in the pose",
        "ours: 0.05 m/s^2 of accelerometer bias",
        least=1e-6,
    )


Angles = tuple[float, float, float]  # flexion, deviation, pronation
NEUTRAL: Angles = (0.0, 0.0, 0.0)
ANGLE_COLUMNS = frozenset(f"{name}_{unit}" for name in DOF_NAMES for unit in ("deg", "sd_deg"))


@dataclass(frozen=True)
class Pose:
    """The pose taken: when, and the joints' angles that are known.

    The other joints are straight, the thumb aligned with the fingers.
    """

    onset: float  # s
    duration: float  # s
    thumb_cmc: Angles = NEUTRAL  # rad
    passive: bool = False  # the therapist laid the hand so
    measured: Mapping[str, Angles] = field(default_factory=dict)  # rad, by other joint
    # rad, by joint, of what was measured; NaN: as well as a person takes the pose
    sd: Mapping[str, Angles] = field(default_factory=dict)
    repetition: int = 1  # from 2 on: the pose before taken again, the hand lifted between
    unread: tuple[str, ...] = ()  # details in degrees that name no freedom of a joint

    @property
    def end(self) -> float:
        return self.onset + self.duration


def calibrated_part(pose: Pose, calibration: Calibration) -> Pose:
    """The pose as long as its calibration was taken from it: the stillest stretch."""
    return replace(pose, onset=calibration.t, duration=calibration.end - calibration.t)


def pose_of(event: Event) -> Pose:
    """The pose that an `initial_pose` event describes (docs/motion-bids.md)."""
    known = {joint.name: _known_angles(event, joint, "deg", 0.0) for joint in JOINTS}
    sd = {joint.name: _known_angles(event, joint, "sd_deg", np.nan) for joint in JOINTS}
    return Pose(
        event.onset,
        event.duration,
        known["thumb_cmc"],
        event.details.get("held_by") == THERAPIST,
        {name: a for name, a in known.items() if a != NEUTRAL and name != "thumb_cmc"},
        {name: a for name, a in sd.items() if not np.isnan(a).all()},
        _repetition(event),
        tuple(k for k in sorted(event.details) if k.endswith("_deg") and k not in ANGLE_COLUMNS),
    )


def _repetition(event: Event) -> int:
    given = event.details.get("repetition")
    try:
        value = 1 if given is None else int(given)
    except (TypeError, ValueError):
        value = 0
    if value < 1:
        raise InputError("calibration.pose_repetition", at=event.onset, what=str(given))
    return value


def _known_angles(event: Event, joint: Joint, unit: str, otherwise: float) -> Angles:
    """A joint's angles, or their standard deviations, that the event holds, rad; `otherwise` where it holds none."""
    found = [otherwise] * 3
    for k in joint.dofs:
        column = f"{joint.name}_{joint_angles.ANGLES[k]}_{unit}"
        given = event.details.get(column)
        if given is None:
            continue
        try:
            found[k] = float(given) * DEG
        except (TypeError, ValueError):
            found[k] = np.nan
        if not (np.isfinite(found[k]) and (unit == "deg" or found[k] > 0)):
            raise InputError(
                "calibration.pose_angle_form", at=event.onset, what=str(given), column=column
            )
        low, high = LIMITS[JOINT[joint.name], k]
        if unit == "deg" and not low - BEYOND_LIMITS <= found[k] <= high + BEYOND_LIMITS:
            raise InputError(
                "calibration.pose_angle_impossible",
                at=event.onset,
                value=found[k] / DEG,
                column=column,
                low=low / DEG,
                high=high / DEG,
            )
    return found[0], found[1], found[2]


def segments_in_pose(pose: Pose) -> dict[str, Array]:
    """Orientation of every segment on the hand (4,) while the pose is held."""
    angles = {"thumb_cmc": pose.thumb_cmc, **pose.measured}
    q_pc = {j.name: joint_angles.compose(np.array(angles.get(j.name, NEUTRAL))) for j in JOINTS}
    on_hand = {"hand": quat.IDENTITY, "forearm": quat.conjugate(q_pc["wrist"])}
    for joint in JOINTS[1:]:  # from the hand outwards
        on_hand[joint.child] = quat.multiply(on_hand[joint.parent], q_pc[joint.name])
    return {segment: on_hand[segment] for segment in SEGMENTS}


def calibrate(
    params: PoseParams,
    hand: Hand,
    geometry: HandGeometry,
    mounting: Mapping[str, Array],
    blocks: Sequence[Block],
    pose: Pose,
) -> Calibration:
    """Calibrate from the inertial samples of the pose (one block a stream); refuses a pose that is
    short, incomplete or not still."""
    inertial = [b for b in blocks if b.stream.inertial]
    _refuse_outside(inertial, pose)
    window = _stillest_stretch(params, [b.between(pose.onset, pose.end) for b in inertial], pose)
    still = {name: s for b in window for name, s in held_still(b, params.pose_duration).items()}
    if "hand" not in still:
        raise InputError("calibration.pose_without_hand_samples", time=pose.onset)
    quality = {name: stillness(s) for name, s in still.items()}
    _refuse_movement(params, quality, pose)
    q_GS, q_BS = _orient(params, still, mounting, pose, palm_down(hand))
    bias = {name: s.mean[:3] for name, s in still.items()}
    quality = {
        name: _with_misalignment(q, mounting.get(name, quat.IDENTITY), q_BS[name])
        for name, q in quality.items()
    }
    start, end = min(b.t[0] for b in window if len(b.t)), max(b.t[-1] for b in window if len(b.t))
    rates = measure_rates(b.between(pose.onset, pose.end) for b in blocks)
    warnings = (
        *_warnings(still, mounting, q_GS, pose),
        *rate_warnings(rates, [b.stream for b in blocks]),
    )
    north = _magnetic_headings(q_GS, [b.between(start, end) for b in blocks])
    source = CalibrationSource.PASSIVE_POSE if pose.passive else CalibrationSource.POSE
    return Calibration(
        hand,
        geometry,
        float(start),
        float(end),
        q_GS,
        q_BS,
        bias,
        source,
        quality,
        warnings,
        north,
        rates,
        nominal=nominal_mounting(still, mounting) if params.alignment != "heading" else {},
        pose_sd=pose.sd,
        q_ES=mean_orientations([b.between(start, end) for b in blocks]),
    )


def nominal_mounting(sensors: Iterable[str], mounting: Mapping[str, Array]) -> dict[str, Array]:
    """Sensor-to-segment rotations (4,) that the glove declares."""
    return {
        s: quat.normalize(np.asarray(mounting.get(s, quat.IDENTITY), dtype=float)) for s in sensors
    }


def uncalibrated(
    hand: Hand,
    geometry: HandGeometry,
    mounting: Mapping[str, Array],
    sensors: Sequence[str],
    t: float,
) -> Calibration:
    """What is known without any pose: the nominal mounting; headings come from magnetometers or are
    guesses."""
    nominal = nominal_mounting([s for s in sensors if s in SEGMENTS], mounting)
    return Calibration(hand, geometry, t, t, {}, nominal, {}, CalibrationSource.NONE)


def guess_calibration(
    params: PoseParams,
    hand: Hand,
    geometry: HandGeometry,
    mounting: Mapping[str, Array],
    blocks: Sequence[Block],
) -> Calibration:
    """Without any pose, for a method that needs one: nominal mounting, gravity of this moment,
    headings as if every segment pointed as the hand does."""
    window = [b for b in blocks if b.stream.inertial and len(b.t)]
    still = {name: s for b in window for name, s in held_still(b).items()}
    if "hand" not in still:
        raise InputError("calibration.no_hand_samples")
    start, end = min(float(b.t[0]) for b in window), max(float(b.t[-1]) for b in window)
    q_GS, q_BS = _orient(
        replace(params, alignment="heading"),
        still,
        mounting,
        Pose(start, end - start),
        palm_down(hand),
    )
    return Calibration(
        hand,
        geometry,
        start,
        end,
        q_GS,
        q_BS,
        {},
        CalibrationSource.NONE,
        {},
        (UNCALIBRATED,),
        _magnetic_headings(q_GS, blocks),
        q_ES=mean_orientations(window),
    )


def rate_warnings(rates: Mapping[str, float], streams: Sequence[Stream]) -> tuple[str, ...]:
    """A sentence for each stream whose samples come clearly faster or slower than it says."""
    named = {s.name: s.rate for s in streams}
    return tuple(
        phrase("calibration.sample_rate", stream=name, rate=rate, named=named[name])
        for name, rate in rates.items()
        if abs(rate / named[name] - 1.0) > RATE_DOUBT
    )


def _magnetic_headings(q_GS: Mapping[str, Array], blocks: Sequence[Block]) -> dict[str, float]:
    """Heading of magnetic north (rad, from the global y axis towards x) in each magnetometer's mean
    over the pose."""
    found = {}
    for block in (b for b in blocks if MAG in b.stream.quantities):
        for k, name in enumerate(block.stream.sensors):
            mag = block.of(MAG)[:, k]
            mag = mag[np.isfinite(mag).all(axis=1)]
            if name in q_GS and len(mag):
                x, y, _ = quat.rotate(q_GS[name], mag.mean(axis=0))
                found[name] = float(np.arctan2(x, y))
    return found


@dataclass(frozen=True)
class _Still:
    """One sensor's samples in the pose: their mean and the means of its one-second pieces,
    gyroscope then accelerometer."""

    mean: Array  # (6,)
    pieces: Array  # (pieces, 6)
    rate_sd: float | None  # rad/s, of the mean of each gyroscope axis
    rate_noise: float | None  # rad/s/sqrt(Hz)


def held_still(block: Block, duration: float = 0.0) -> dict[str, _Still]:
    """The sensors that gave at least half of the block's samples and of those that `duration` s
    have."""
    values = np.concatenate([block.of(GYR), block.of(ACC)], axis=-1)
    pieces, least = (
        max(1, round(len(block.t) / block.stream.rate)),
        max(2.0, 0.5 * len(block.t), 0.5 * duration * block.stream.rate),
    )
    found = {}
    whole = is_complete(block)
    for k, name in enumerate(block.stream.sensors):
        samples = values[whole[:, k], k]
        if name in SEGMENTS and len(samples) >= least:
            sure = (
                _mean_sd(samples[:, :3], QUARTERS * pieces),
                white_noise(samples[:, :3], block.stream.rate),
            )
            found[name] = _Still(
                samples.mean(axis=0),
                np.array([p.mean(axis=0) for p in np.array_split(samples, pieces) if len(p)]),
                *sure,
            )
    return found


def _mean_sd(samples: Array, pieces: int) -> float | None:
    """Standard deviation of the mean of samples (n, 3), one of all axes, as the means of their
    pieces scatter; None where pieces are too short."""
    if len(samples) < LEAST_SAMPLES:
        return None
    means = np.array([p.mean(axis=0) for p in np.array_split(samples, pieces)])
    return float(np.sqrt(means.var(axis=0, ddof=1).mean() / pieces))


def white_noise(samples: Array, rate: float) -> float | None:
    """Density of the white noise in samples (n, axes) at `rate` Hz, in their unit per sqrt(Hz);
    None where there are too few samples.

    The eighth differences pass what is near the highest frequency alone: of a tremor at a tenth of
    the rate 2e-4 of its size. A sensor that filters its samples more narrowly than their rate shows
    less than it has.
    """
    if len(samples) < LEAST_SAMPLES:
        return None
    differences = np.diff(samples, DIFFERENCES, axis=0)
    return float(
        np.sqrt((differences**2).mean() / math.comb(2 * DIFFERENCES, DIFFERENCES) / (rate / 2))
    )


def _refuse_outside(blocks: list[Block], pose: Pose) -> None:
    spans = np.array([(b.t[0], b.t[-1]) for b in blocks if len(b.t)])
    if len(spans) and (pose.onset > spans[:, 1].max() or pose.end < spans[:, 0].min()):
        raise InputError(
            "calibration.pose_outside",
            time=pose.onset,
            start=float(spans[:, 0].min()),
            end=float(spans[:, 1].max()),
        )


def _stillest_stretch(params: PoseParams, window: list[Block], pose: Pose) -> list[Block]:
    """The stretch of `pose_duration` in which the gyroscopes vary least; the whole window where it
    is not longer."""
    longest = max((b.t[-1] - b.t[0] + 1 / b.stream.rate for b in window if len(b.t)), default=0.0)
    if longest < params.pose_duration - 0.05:
        raise InputError(
            "calibration.pose_too_short",
            time=pose.onset,
            length=longest,
            needed=params.pose_duration,
        )
    slack = longest - params.pose_duration
    if slack < 0.25:
        return window
    starts = min(b.t[0] for b in window if len(b.t)) + np.arange(0.0, slack, 0.1)
    best = float(
        min(
            starts,
            key=lambda s: _unsteadiness(
                [b.between(s, s + params.pose_duration) for b in window], params.pose_duration
            ),
        )
    )
    return [b.between(best, best + params.pose_duration) for b in window]


def _unsteadiness(blocks: list[Block], duration: float) -> tuple[int, float]:
    """How many sensors lack more than a tenth of their samples in a stretch, and how much the
    gyroscopes of the others vary: the least is the best."""
    lacking, spread = 0, 0.0
    for block in blocks:
        gyr, whole = block.of(GYR), is_complete(block)
        for k in range(len(block.stream.sensors)):
            samples = gyr[whole[:, k], k]
            if len(samples) < 0.9 * duration * block.stream.rate:
                lacking += 1
            else:
                spread += float(samples.var(axis=0).sum())
    return lacking, spread


def stillness(still: _Still) -> SensorQuality:
    """How still one sensor was held."""
    rates = still.pieces[:, :3] - still.mean[:3]
    direction = still.pieces[:, 3:] / np.linalg.norm(still.pieces[:, 3:], axis=1, keepdims=True)
    tilt = max(float(np.arccos(np.clip(d @ direction.T, -1, 1)).max()) for d in direction)
    wander, bias = float(np.linalg.norm(rates, axis=1).max()), float(np.linalg.norm(still.mean[:3]))
    return SensorQuality(
        wander, tilt, bias, 0.0, bias_sd=still.rate_sd, rate_noise=still.rate_noise
    )


def _refuse_movement(params: PoseParams, quality: Mapping[str, SensorQuality], pose: Pose) -> None:
    limits = {
        "rate_wander": (phrase("calibration.turned_at"), "deg/s", params.pose_rate),
        "tilt_change": (phrase("calibration.tilted_by"), "deg", params.pose_tilt),
        "bias": (phrase("calibration.turned_steadily"), "deg/s", params.pose_bias),
    }
    for what, (verb, unit, limit) in limits.items():
        worst = max(quality, key=lambda name: getattr(quality[name], what))
        value = getattr(quality[worst], what) / DEG
        if value > limit:
            raise InputError(
                "calibration.pose_not_still",
                time=pose.onset,
                sensor=worst,
                verb=verb,
                value=value,
                unit=unit,
                limit=limit,
            )


def _orient(
    params: PoseParams,
    still: Mapping[str, _Still],
    mounting: Mapping[str, Array],
    pose: Pose,
    q_GH_guess: Array,
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Sensor orientations with gravity's inclination and the pose's heading, and the
    sensor-to-segment rotations."""
    nominal = nominal_mounting(still, mounting)
    on_hand, q_GS, q_BS = segments_in_pose(pose), {}, {}
    agreeing = (
        [name for name in still if name != "forearm"] if params.alignment == "common" else ["hand"]
    )
    q_GH = make_upright(q_GH_guess, _up_in_hand(still, nominal, on_hand, agreeing))
    for name, samples in still.items():
        q_GB = quat.multiply(q_GH, on_hand[name])
        q_GS[name] = make_upright(quat.multiply(q_GB, nominal[name]), samples.mean[3:])
        q_BS[name] = (
            quat.relative(q_GB, q_GS[name]) if params.alignment != "heading" else nominal[name]
        )
    return q_GS, q_BS


def _up_in_hand(
    still: Mapping[str, _Still],
    nominal: Mapping[str, Array],
    on_hand: Mapping[str, Array],
    names: Sequence[str],
) -> Array:
    """Upwards (3,) in the hand's frame as most of these sensors have it: each is misaligned in its own
    way, and the pose makes their segments agree."""
    ups = [
        quat.rotate(
            quat.multiply(on_hand[n], nominal[n]),
            still[n].mean[3:] / np.linalg.norm(still[n].mean[3:]),
        )
        for n in names
    ]
    return np.asarray(np.median(ups, axis=0))


def palm_down(hand: Hand) -> Array:
    """Orientation of a hand that lies palm down with the fingers along the global y axis: where
    headings start to count."""
    sign = 1.0 if hand == "left" else -1.0
    return quat.from_matrix(np.column_stack([(0, 0, sign), (0, sign, 0), (-1, 0, 0)]))


def _with_misalignment(q: SensorQuality, nominal: Array, q_BS: Array) -> SensorQuality:
    return replace(q, misalignment=float(quat.angle(quat.relative(nominal, q_BS))))


def _warnings(
    still: Mapping[str, _Still],
    mounting: Mapping[str, Array],
    q_GS: Mapping[str, Array],
    pose: Pose,
) -> tuple[str, ...]:
    warnings = []
    if pose.unread:
        columns = ", ".join(pose.unread)
        warnings.append(phrase("calibration.pose_columns_unread", at=pose.onset, columns=columns))
    for name, samples in still.items():
        g = float(np.linalg.norm(samples.mean[3:]))
        if abs(g - GRAVITY) > 1.0:
            warnings.append(
                phrase("calibration.resting_gravity", sensor=name, g=g, expected=GRAVITY)
            )
    return tuple(warnings)


def reorient(calibration: Calibration, beginning: Sequence[Block]) -> dict[str, Array]:
    """Orientations of the sensors at another moment (4,) by segment: inclination from these
    samples, headings as in the calibration's pose."""
    still = {name: s for b in beginning for name, s in held_still(b).items()}
    return {
        name: make_upright(q_GS, still[name].mean[3:])
        for name, q_GS in calibration.q_GS.items()
        if name in still
    }
