"""MAP: the hand calibrates itself from a stretch of free movement; lengths, seats of sensors, biases and the movement are found at once.

In      inertial samples of the hand and of fingers of which at least the first phalanx has a sensor; no pose, no magnetometer
Out     Calibration (seats, biases, lengths) at the stretch's beginning; Trajectory: the stretch as it was found, the rest tracked as `m2` does from there
Source  Kortier, thesis ch. 4; estimators/self_calibration
Limits  how the sensors of forearm and hand sit, and the last phalanges' about a finger's axis, is told by no movement: there the nominal mounting
        holds, so the zeros of the wrist and of the MCP and DIP joints' flexion are as good as the mounting; last phalanges' lengths by ratio, or what is left of a finger's measured one
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.options import option
from handscope.estimators.data.samples import Block, Recording
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand import forward_kinematics, joint_angles, length_covariance
from handscope.estimators.hand.anatomy import (
    CHAINS,
    CHILDREN,
    DEVIATION,
    FINGERS,
    FLEXION,
    IS_DOF,
    JOINT,
    PARENTS,
    SEGMENT,
    SEGMENTS,
    side_sign,
)
from handscope.estimators.hand.geometry import HandGeometry, root_joint, with_finger_lengths
from handscope.estimators.methods import fusion_pipeline, m2
from handscope.estimators.numerics import parallel
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.run import run
from handscope.estimators.self_calibration import initialisation as self_calibration_initialisation
from handscope.estimators.self_calibration import messages as self_calibration_messages
from handscope.estimators.self_calibration import (
    normal_equations,
    sample_preparation,
    segments,
    solver,
)
from handscope.estimators.self_calibration import result as self_calibration_result
from handscope.estimators.self_calibration.problem import (
    LIMBS,
    Chain,
    Noise,
    Readings,
    Unknowns,
    Z,
    axis_in_sensors,
    build_chain,
    build_problem,
    parameter_columns,
    with_lengths,
)
from handscope.estimators.self_calibration.result import Finger, Requirements
from handscope.estimators.self_calibration.solver import Limits, Solution
from handscope.estimators.self_calibration.uncertainty import monte_carlo, posterior
from handscope.estimators.self_calibration.uncertainty.monte_carlo import DRAWS
from handscope.estimators.self_calibration.whole_hand import solver as whole_hand_solver

TITLE = "self-calibration from free movement, no pose, no magnetometer (Kortier 2018, ch. 4)"
NEEDS_POSE = False
TRIED = "self-calibration (map) was tried on simulated recordings only (docs/methods.md)"
ALONE = (
    "hand and fingers as one problem did not come to an end: each finger is as it was found alone; skin under the hand's sensor was not counted,"
    " first phalanges' lengths may be off by several of their standard deviations"
)
TOGETHER = Limits(
    iterations=25, least_gain=0.25
)  # begun where each finger has its minimum: the next step would gain a hundredth of that
RIGID = 1e-3  # share of skin's movement that nobody notices
SHARE = 0.6  # of the time, for which fingers are solved one by one
UNKNOWN = np.radians(
    60.0
)  # standard deviation of an angle of which nothing is known: what joints can do at all
UNKNOWN_TIP = 0.05  # m, the same of a fingertip, which moves about over a decimetre


@dataclass(frozen=True, kw_only=True)
class Params(fusion_pipeline.Params, Noise, Requirements):
    longest: float = option(
        60.0,
        "s",
        "longest stretch that is calibrated from: the one with most movement",
        "ours: the thesis' 40 s and some more",
        least=5.0,
    )
    length_guess: float = option(
        0.05,
        "1",
        "how far a length that no movement tells may be off, share of it",
        "Salchow-Hoemmen 2019, 5: ratios vary by a few percents; size ours",
    )
    hand_skin: float = option(
        1.0,
        "1",
        "how far skin moves the hand's sensor with the fingers, before that is known: share of what it was found to do to the fingers' own sensors;"
        " 0 where the hand's sits on something rigid",
        "ours: skin of the back of the hand moves as the fingers' does",
        least=0.0,
    )
    tracked: float = option(
        2.0,
        "deg",
        "standard deviation that tracking adds before and after the stretch",
        "docs/reproduction.md, Table 6, m2: 1.8",
    )


def solve(
    params: Params, recording: Recording, progress: Callable[[float], None] = lambda share: None
) -> tuple[Trajectory, list[Calibration], list[str]]:
    """The whole recording. InputError where nothing moved, or no finger has sensors that hang together with the hand's."""
    blocks = [b for b in whole_streams(list(recording.blocks())) if b.stream.inertial and len(b.t)]
    worn = {name for b in blocks for name in b.stream.sensors}
    if "hand" not in worn:
        raise InputError(
            "the recording has no inertial sensor on the hand; self-calibration needs it: use m2 with an initial pose"
        )
    start, stop, messages = _stretch(params, recording, blocks)
    limbs: list[_Limb] = []
    problems: list[str] = []
    for name in (name for name, links in LIMBS.items() if links[0] in worn):
        try:
            links, silent = sample_preparation.drop_silent_sensors(
                blocks, build_chain([s for s in ("hand", *LIMBS[name]) if s in worn]), start, stop
            )
            messages += self_calibration_messages.describe_silent_sensors(
                name,
                silent,
                any(sample_preparation.is_clipped(blocks, s, start, stop) for s in silent[:1]),
            )
            limbs.append(
                _Limb(
                    name,
                    links,
                    *sample_preparation.prepare_readings(blocks, links.sensors, start, stop),
                )
            )
        except InputError as problem:
            problems.append(str(problem))
    alone = parallel.run_each(
        lambda limb, done: _calibrate_limb(params, recording, limb, done),
        limbs,
        lambda share: progress(SHARE * share),
    )
    problems += dict.fromkeys(str(problem) for problem in alone if isinstance(problem, InputError))
    fingers = [finger for finger in alone if isinstance(finger, Finger)]
    if not any(f.name in CHAINS for f in fingers):
        raise InputError(
            problems[0]
            if problems
            else "no finger has a sensor on its first phalanx; self-calibration needs hand and phalanges"
        )
    fingers, of_hand = _together(params, recording, fingers, progress)
    messages += [
        *problems,
        *of_hand,
        *self_calibration_messages.describe_outliers(fingers),
        *(
            word
            for finger in fingers
            for word in self_calibration_messages.describe_result(params, finger)
        ),
    ]
    calibration = _join_fingers(params, recording, fingers, worn)
    tracked = trajectory.join(run(m2, params, [calibration], recording), recording.hand)
    movement = _with_deviations(
        params, _with_solution(tracked, calibration.geometry, fingers), fingers
    )
    return _over_the_wrist(params, movement, calibration.geometry), [calibration], messages


def _stretch(
    params: Params, recording: Recording, blocks: Sequence[Block]
) -> tuple[float, float, list[str]]:
    """When the hand moved freely, and what is to be said of it: what an event says, else all; of that the liveliest part."""
    events = [e for e in recording.events if e.trial_type == "free_movement"]
    start, stop = max(b.t[0] for b in blocks), min(b.t[-1] for b in blocks)
    if events:
        longest = max(events, key=lambda e: e.duration)
        start, stop = max(start, longest.onset), min(stop, longest.end)
    self_calibration_messages.require_length(params, stop - start)
    whole, holes = stop - start, sample_preparation.find_gaps(blocks, start, stop)
    start, stop = sample_preparation.longest_gapless(blocks, start, stop)
    self_calibration_messages.require_samples(params, stop - start, holes)
    start, stop = sample_preparation.most_excited_stretch(blocks, start, stop, params.longest)
    return start, stop, self_calibration_messages.describe_stretch(start, stop, whole)


@dataclass(frozen=True)
class _Limb:
    """A finger, or the forearm, as it was recorded."""

    name: str
    links: Chain
    t: Array  # (n,) s
    read: Readings


def _calibrate_limb(
    params: Params, recording: Recording, limb: _Limb, progress: Callable[[float], None]
) -> Finger:
    noise = Noise(**{f.name: getattr(params, f.name) for f in fields(Noise)})
    links, t, read = limb.links, limb.t, limb.read
    self_calibration_messages.require_movement(params, limb.name, read)
    guess = self_calibration_initialisation.initial_unknowns(
        links, noise, read, axis_in_sensors(links, recording.mounting, Z)
    )
    problem = with_lengths(
        build_problem(links, noise, read, guess.q_GS[0], recording.hand, recording.mounting),
        recording.geometry.lengths,
    )
    found = solver.solve_with_noise(
        problem,
        guess,
        Limits(),
        lambda k, cost: _report_progress(progress, min(0.9, k / 25)),
    )
    self_calibration_messages.require_one_minimum(params, limb.name, read, found, float(t[0]))
    described = _describe(
        params,
        recording,
        limb.name,
        t,
        found,
        posterior.draw_places(found.problem, found.at, found.factor, DRAWS),
    )
    self_calibration_messages.require_possible(described)
    return replace(
        described,
        solution=replace(
            found, factor=normal_equations.keep_covariance_only(found.factor.covariance)
        ),
    )


def _together(
    params: Params, recording: Recording, alone: list[Finger], progress: Callable[[float], None]
) -> tuple[list[Finger], list[str]]:
    """All fingers, or the only one, as one problem with the hand and its skin; as they were found alone where that does not come to an end."""
    noise = Noise(**{f.name: getattr(params, f.name) for f in fields(Noise)})
    *moving, law = _soft_tissue_scales(params, alone)
    turn, slide = (max(params.hand_skin * softness, RIGID) for softness in moving)
    try:
        found = whole_hand_solver.solve(
            [f.solution for f in alone],
            replace(
                noise,
                skin_turn=turn * noise.skin_turn,
                skin_slide=slide * noise.skin_slide,
                skin_law=law * noise.skin_law,
            ),
            TOGETHER,
            lambda k, cost: _report_progress(progress, min(0.95, SHARE + (0.95 - SHARE) * k / 4)),
        )
    except np.linalg.LinAlgError:
        return alone, [ALONE]
    except InputError as late:  # the time is over
        return alone, [ALONE, str(late)]
    if found.outcome != "converged":
        return alone, [ALONE]
    drawn = zip(*whole_hand_solver.draw_places(found, DRAWS))
    return [
        _describe(
            params, recording, f.name, f.t, replace(limb, outliers=f.solution.outliers), draws
        )
        for f, limb, draws in zip(alone, whole_hand_solver.split_limbs(found), drawn)
    ], [
        word
        for f, misfit in zip(alone, whole_hand_solver.worst_joints(found))
        for word in self_calibration_messages.describe_misfit(f, *misfit)
    ]


def _soft_tissue_scales(params: Params, alone: Sequence[Finger]) -> tuple[float, float, float]:
    """How far skin turns and slides the fingers' sensors, and how far from proportion, shares of what was believed: what was found and what it may be off by, squared and added,
    is the variance that makes the found most likely (the M step of Dempster, Laird & Rubin 1977); where movement tells nothing it stays 1."""
    turns, slides, laws = [], [], []
    for found in (finger.solution for finger in alone if finger.name in CHAINS):
        c, variance = parameter_columns(found.problem.chain), np.diag(found.factor.covariance)
        turns.append(found.at.skin_turn.ravel() ** 2 + variance[c.skin_turn])
        slides.append(found.at.skin_slide.ravel() ** 2 + variance[c.skin_slide])
        laws.append(found.at.law**2 + variance[c.law])
    turn, slide, law = (
        float(np.sqrt(np.concatenate(squares).mean())) for squares in (turns, slides, laws)
    )
    quarter = np.pi / 2
    return (
        quarter * turn / np.radians(params.skin_turn),
        quarter * slide / (1e-3 * params.skin_slide),
        law / params.skin_law,
    )


def _describe(
    params: Params,
    recording: Recording,
    finger: str,
    t: Array,
    found: Solution,
    draws: Iterable[Unknowns],
) -> Finger:
    """What a solution says of a finger."""
    described = segments.of_solution(found, recording.hand, recording.mounting)
    sure = monte_carlo.estimate_uncertainty(
        found,
        draws,
        recording.hand,
        recording.mounting,
        np.radians(params.mounting),
        lambda drawn, luck: with_finger_lengths(
            recording.geometry, finger, drawn.lengths, params.length_guess * luck
        ),
    )
    return Finger(finger, t, found, described, sure)


def _report_progress(progress: Callable[[float], None], share: float) -> bool:
    progress(share)
    return True


def _join_fingers(
    params: Params, recording: Recording, fingers: Sequence[Finger], worn: set[str]
) -> Calibration:
    """One calibration of all fingers: they share the hand's orientation, that of the first."""
    first = fingers[0]
    known = initial_pose.uncalibrated(
        recording.hand,
        recording.geometry,
        recording.mounting,
        sorted(worn & set(SEGMENTS)),
        float(first.t[0]),
    )
    q_GS, q_BS, bias = dict(known.q_GS), dict(known.q_BS), dict(known.gyr_bias)
    for finger in fingers:
        at, sensors = finger.solution.at, finger.solution.problem.chain.sensors
        onto = quat.multiply(first.solution.at.q_GS[0, 0], quat.conjugate(at.q_GS[0, 0]))
        for s, name in enumerate(sensors):
            if name != "hand" or finger is first:
                q_GS[name], bias[name] = quat.multiply(onto, at.q_GS[0, s]), at.bias_gyr[s]
        q_BS |= finger.segments.q_BS
    geometry = _with_lengths(params, recording.geometry, fingers)
    nearest = sorted(fingers, key=lambda f: float(np.linalg.norm(_end(f, geometry))))
    return replace(
        known,
        q_GS=q_GS,
        q_BS=q_BS,
        gyr_bias=bias,
        geometry=geometry,
        source="self-calibration",
        stretch=(max(float(f.t[0]) for f in fingers), min(float(f.t[-1]) for f in fingers)),
        warnings=(TRIED,),
        p_BS=_first_of(nearest, lambda f: _known_places(params, f, _places(f, geometry))),
        acc_bias={
            n: f.solution.at.bias_acc[s]
            for f in reversed(fingers)
            for s, n in enumerate(f.solution.problem.chain.sensors)
        },
        q_BS_sd=_first_of(fingers, lambda f: f.sure.q_BS),
        p_BS_sd=_first_of(
            nearest, lambda f: _known_places(params, f, _places_sd(params, f, geometry))
        ),
        gyr_bias_sd=_first_of(
            fingers, lambda f: _bias_sd(f, parameter_columns(f.solution.problem.chain).bias_gyr)
        ),
        acc_bias_sd=_first_of(
            fingers, lambda f: _bias_sd(f, parameter_columns(f.solution.problem.chain).bias_acc)
        ),
        lengths_sd={
            s: sd
            for f in fingers
            for s, sd in f.segments.lengths_sd.items()
            if self_calibration_result.is_length_known(params, f, s)
        },
    )


def _first_of(
    fingers: Sequence[Finger], known: Callable[[Finger], Mapping[str, Array]]
) -> dict[str, Array]:
    """By segment; of the hand as the first of these fingers has it."""
    return {s: value for f in reversed(fingers) for s, value in known(f).items()}


def _bias_sd(finger: Finger, where: slice) -> dict[str, Array]:
    sd = np.sqrt(np.diag(finger.solution.factor.covariance)[where]).reshape(-1, 3)
    return dict(zip(finger.solution.problem.chain.sensors, sd))


def _known_places(params: Params, finger: Finger, known: Mapping[str, Array]) -> dict[str, Array]:
    """Of the sensors whose places movement told."""
    return {
        s: value
        for s, value in known.items()
        if self_calibration_result.is_placed(params, finger, s)
    }


def _places(finger: Finger, geometry: HandGeometry) -> dict[str, Array]:
    """Where the sensors sit from their segments' origins: the hand's is MCP 3, a last phalanx' the end of its bone, the forearm's the wrist."""
    found = dict(finger.segments.p_BS)
    found["hand"] = found["hand"] + _end(finger, geometry)
    if finger.name in CHAINS:
        last = finger.solution.problem.chain.sensors[-1]
        along = (
            geometry.lengths[last] if last == CHAINS[finger.name][-1] else np.nan
        )  # a joint that no sensor shows
        found[last] = found[last] - side_sign(geometry.hand) * np.array([0.0, along, 0.0])
    return {s: p for s, p in found.items() if np.isfinite(p).all()}


def _end(finger: Finger, geometry: HandGeometry) -> Array:
    """Where a finger, or the forearm, hangs on the hand (3,) m, from the hand's origin."""
    ends = (
        geometry.joint_positions[root_joint(finger.name)]
        if finger.name in CHAINS
        else (0.0, 0.0, 0.0)
    )
    return np.subtract(ends, geometry.joint_positions["middle_mcp"])


def _places_sd(params: Params, finger: Finger, geometry: HandGeometry) -> dict[str, Array]:
    """(3,) m; the hand's is counted from MCP 3, the last phalanx' from an end that no movement shows."""
    off = params.length_guess * float(np.linalg.norm(_end(finger, geometry)))
    sds = {**finger.sure.p_BS, "hand": np.hypot(finger.sure.p_BS["hand"], off)}
    if finger.name in CHAINS:
        last = finger.solution.problem.chain.sensors[-1]
        sds[last] = np.hypot(sds[last], [0.0, params.length_guess * geometry.lengths[last], 0.0])
    return {s: sds[s] for s in _places(finger, geometry)}


def _with_lengths(
    params: Params, geometry: HandGeometry, fingers: Sequence[Finger]
) -> HandGeometry:
    """With the lengths that movement told."""
    for finger in fingers:
        known = {
            s: v
            for s, v in finger.segments.lengths.items()
            if self_calibration_result.is_length_known(params, finger, s)
        }
        geometry = with_finger_lengths(geometry, finger.name, known)
    return geometry


def _with_solution(
    tracked: Trajectory, geometry: HandGeometry, fingers: Sequence[Finger]
) -> Trajectory:
    """The tracked movement with the stretch as self-calibration found it, fingers on the hand's tracked orientation."""
    q_GS, t = tracked.q_GS.copy(), tracked.t
    start, stop = max(f.t[0] for f in fingers), min(f.t[-1] for f in fingers)
    inside = (t >= start) & (t <= stop)
    hand = q_GS[inside, SEGMENT["hand"]]
    for finger in fingers:
        for name, q_GB in finger.segments.q_GB.items():
            if name != "hand":
                on_hand = quat.relative(finger.segments.q_GB["hand"], q_GB)
                q_GS[inside, SEGMENT[name]] = quat.multiply(hand, _at(t[inside], finger.t, on_hand))
    angles = tracked.angles.copy()
    free = joint_angles.constrain(joint_angles.of_segments(q_GS[inside]))
    angles[inside] = joint_angles.mask_non_freedoms(free)
    tips = tracked.tips.copy()
    tips[inside] = forward_kinematics.tips(joint_angles.compose(free), geometry)
    return replace(tracked, q_GS=q_GS, angles=angles, tips=tips)


def _with_deviations(params: Params, movement: Trajectory, fingers: Sequence[Finger]) -> Trajectory:
    """Standard deviations of the stretch, larger before and after it; fingers that were not calibrated are flagged, nothing is known of them."""
    angles = np.where(np.isnan(movement.angles), np.nan, UNKNOWN)
    tips, flags = np.where(np.isnan(movement.tips), np.nan, UNKNOWN_TIP), movement.flags.copy()
    outside = (movement.t < max(f.t[0] for f in fingers)) | (
        movement.t > min(f.t[-1] for f in fingers)
    )
    drift = np.where(outside, np.radians(params.tracked), 0.0)
    for finger in fingers:
        knots, sure = finger.t[finger.sure.rows], finger.sure
        for j, a in zip(*np.nonzero(np.isfinite(sure.angles).all(axis=0) & IS_DOF)):
            angles[:, j, a] = np.hypot(np.interp(movement.t, knots, sure.angles[:, j, a]), drift)
        reach = sum(finger.segments.lengths.values())
        for axis in range(3 if finger.name in CHAINS else 0):
            tips[:, FINGERS.index(finger.name), axis] = np.hypot(
                np.interp(movement.t, knots, sure.tip[:, axis]), drift * reach
            )
    lost = outside[:, None] & (movement.flags & np.uint8(Flag.HEADING_LOST) > 0)
    angles = np.where(
        (lost[:, PARENTS] | lost[:, CHILDREN])[..., None] & np.isfinite(angles), UNKNOWN, angles
    )
    on_fingers = np.stack(
        [lost[:, [SEGMENT[s] for s in links]].any(axis=1) for links in CHAINS.values()], axis=1
    )
    tips = np.where(on_fingers[..., None] & np.isfinite(tips), UNKNOWN_TIP, tips)
    known = {s for f in fingers for s in f.solution.problem.chain.sensors}
    for name in SEGMENTS:
        if name not in known and np.isfinite(movement.q_GS[:, SEGMENT[name], 0]).any():
            flags[:, SEGMENT[name]] |= np.uint8(Flag.UNCALIBRATED)
    return replace(movement, angles_sd=angles, tips_sd=tips, flags=flags)


def _over_the_wrist(params: Params, movement: Trajectory, geometry: HandGeometry) -> Trajectory:
    """Tips are told in the wrist's frame: they are as uncertain as its angles, where it is followed, and as the fingers' roots, which no movement tells."""
    assert movement.angles_sd is not None and movement.tips_sd is not None
    angles, tips = np.where(IS_DOF, movement.angles, 0.0), movement.tips_sd
    for axis in (FLEXION, DEVIATION):
        turned = angles.copy()
        turned[:, JOINT["wrist"], axis] += movement.angles_sd[:, JOINT["wrist"], axis]
        here, there = (
            forward_kinematics.tips(joint_angles.compose(a), geometry) for a in (angles, turned)
        )
        tips = np.hypot(tips, np.nan_to_num(there - here))  # an unknown wrist counts as neutral
    turn = quat.matrix(joint_angles.compose(np.nan_to_num(angles[:, JOINT["wrist"]])))
    of_roots = length_covariance.covariance(geometry, params.length_guess)[:, :3, :3]
    return replace(
        movement,
        tips_sd=np.hypot(tips, np.sqrt(np.einsum("nij,fjk,nik->nfi", turn, of_roots, turn))),
    )


def _at(t: Array, known: Array, q: Array) -> Array:
    """Orientations between those of `known` instants."""
    k = np.clip(np.searchsorted(known, t, side="right") - 1, 0, len(known) - 2)
    weight = np.clip((t - known[k]) / (known[k + 1] - known[k]), 0.0, 1.0)
    return quat.slerp(q[k], q[k + 1], weight)
