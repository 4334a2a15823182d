"""MAP: the hand calibrates itself from a stretch of free movement; lengths, mountings of sensors,
biases and the movement are found at once.

In      inertial samples of the hand and of fingers of which at least the first phalanx has a
        sensor; no magnetometer; an initial pose and held contacts where there are any
Out     Calibration (mountings, biases, lengths) at the stretch's beginning; Trajectory: the stretch as
        it was found, the rest tracked as `m2` does from there
Source  Kortier, thesis ch. 4; estimators/self_calibration
Limits  how the sensors of forearm and hand sit, and the last phalanges' about a finger's axis, is
        shown by no movement: there the nominal mounting holds, and what pose and contacts tell, so
        the zeros of the wrist and of the MCP and DIP joints' flexion are as good as these; last phalanges' lengths by ratio,
        or what is left of a finger's measured one
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.contact_constraint import kind_sd
from handscope.estimators.data.held_contact import HeldContact, held_contacts
from handscope.estimators.data.options import part_of
from handscope.estimators.data.samples import Block, Recording
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import (
    CHAINS,
)
from handscope.estimators.hand.geometry import with_finger_lengths
from handscope.estimators.messages.sentence import Sentence, phrase
from handscope.estimators.methods import m2, map_contacts, map_pose
from handscope.estimators.methods.map_options import Params as Params
from handscope.estimators.methods.map_result import (
    add_wrist_uncertainty,
    flag_uncalibrated,
    join_fingers,
    with_deviations,
    with_solution,
)
from handscope.estimators.numerics import parallel
from handscope.estimators.numerics.native_libraries import (
    freed_memory_returned,
    single_threaded_blas,
)
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.contacts import contact_messages
from handscope.estimators.pipeline.method import Capabilities
from handscope.estimators.pipeline.process import whole_of
from handscope.estimators.pipeline.recording_calibration import initial_poses
from handscope.estimators.pipeline.run import run
from handscope.estimators.self_calibration import initialisation as self_calibration_initialisation
from handscope.estimators.self_calibration import messages as self_calibration_messages
from handscope.estimators.self_calibration import (
    multi_resolution,
    normal_equations,
    sample_preparation,
    segments,
    solver,
)
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
from handscope.estimators.self_calibration.result import Finger
from handscope.estimators.self_calibration.solver import Limits, Solution
from handscope.estimators.self_calibration.uncertainty import monte_carlo, posterior
from handscope.estimators.self_calibration.uncertainty.monte_carlo import DRAWS
from handscope.estimators.self_calibration.whole_hand import solver as whole_hand_solver

TITLE = phrase("method_title.map")
CAPABILITIES = Capabilities(
    needs_pose=False, batch_only=True, gives_covariance=True, couples_chains=True
)
ALONE = phrase("map.fingers_alone")
# begun where each finger has its minimum: the next step would gain a hundredth of that
TOGETHER = Limits(iterations=25, least_gain=0.25, chord=0.01)
RIGID = 1e-3  # share of the soft-tissue artefact that is negligible
SAMPLES_A_PERIOD = 10.0  # of the fastest movement, at least
LEAST_SAMPLES = 1000  # that are kept of a stretch of as many
TWO_AT_ONCE = 4000  # samples of a limb up to which two are solved at once: each takes 25 kB
SHARE = 0.6  # of the time, for which fingers are solved one by one


@single_threaded_blas()
def solve(
    params: Params, recording: Recording, progress: Callable[[float], None] = lambda share: None
) -> tuple[Trajectory, list[Calibration], list[str]]:
    """The whole recording. InputError where nothing moved, or no finger has sensors that hang
    together with the hand's."""
    fingers, worn, messages = _calibrate_stretch(params, recording, progress)
    calibration = join_fingers(params, recording, fingers, worn)
    held = [h for h in held_contacts(recording.events) if kind_sd(params, h) > 0]
    if held or initial_poses(recording.events):
        found, refused = _apply_contacts(params, recording, calibration, fingers, held)
        messages += [*refused, *map(Sentence, contact_messages(found.outcomes))]
        calibration = replace(
            join_fingers(params, recording, found.fingers, worn), geometry=found.geometry
        )
        fingers = found.fingers
    return _movement(params, recording, calibration, fingers), [calibration], messages


def _calibrate_stretch(
    params: Params, recording: Recording, progress: Callable[[float], None]
) -> tuple[list[Finger], set[str], list[str]]:
    """What a stretch of free movement tells of fingers and forearm, the sensors that are worn, and messages."""
    blocks = [b for b in whole_of(recording) if b.stream.inertial]
    worn = {name for b in blocks for name in b.stream.sensors}
    if "hand" not in worn:
        raise InputError("method.no_hand_sensor")
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
    alone = _calibrate_limbs(params, recording, limbs, lambda share: progress(SHARE * share))
    problems += dict.fromkeys(str(problem) for problem in alone if isinstance(problem, InputError))
    fingers = [finger for finger in alone if isinstance(finger, Finger)]
    if not any(f.name in CHAINS for f in fingers):
        raise InputError(problems[0] if problems else phrase("self_calibration.no_first_phalanx"))
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
    return fingers, worn, messages


@freed_memory_returned()
def _apply_contacts(
    params: Params,
    recording: Recording,
    calibration: Calibration,
    fingers: Sequence[Finger],
    held: Sequence[HeldContact],
) -> tuple[map_contacts.Found, list[str]]:
    """What the initial pose and held contacts tell of the fingers, and why poses are refused."""
    movement = _movement(map_pose.unseated(params), recording, calibration, fingers)
    pose, refused = map_pose.find_pose(params, recording, movement, calibration, fingers)
    return map_contacts.apply(params, movement, calibration, fingers, held, pose), refused


@freed_memory_returned()
def _movement(
    params: Params, recording: Recording, calibration: Calibration, fingers: Sequence[Finger]
) -> Trajectory:
    """The recording tracked with a calibration, its stretch as it was found, with standard deviations; made a piece at a time, so that the whole is in memory once."""

    def describe(tracked: Trajectory) -> Trajectory:
        found = with_solution(tracked, calibration.geometry, fingers)
        return add_wrist_uncertainty(
            params, with_deviations(params, found, fingers), calibration.geometry
        )

    pieces = run(m2, params, [calibration], recording)
    longest = max(len(b.t) for b in whole_of(recording))
    movement = trajectory.join((describe(p) for p in pieces if len(p)), recording.hand, longest)
    flag_uncalibrated(movement, fingers)
    return movement


def _stretch(
    params: Params, recording: Recording, blocks: Sequence[Block]
) -> tuple[float, float, list[str]]:
    """Interval of free movement, from its event or the whole recording, and messages; of a long one the most excited part."""
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


@freed_memory_returned()
def _calibrate_limbs(
    params: Params,
    recording: Recording,
    limbs: Sequence[_Limb],
    progress: Callable[[float], None],
) -> list[Finger | InputError]:
    """Every limb for itself, all with the same samples: those that the movement needs, or all where that is not enough."""
    every = _kept_samples(params, limbs)
    longest = max((len(limb.t) for limb in limbs), default=0)

    def solve_each(every: int) -> list[Finger | InputError | None]:
        return parallel.run_each(
            lambda limb, done: _calibrate_limb(params, recording, limb, every, done),
            limbs,
            progress,
            1 if longest // every > TWO_AT_ONCE else parallel.THREADS,
        )

    alone = solve_each(every)
    if any(found is None for found in alone):
        alone = solve_each(1)
    return [found for found in alone if found is not None]


def _kept_samples(params: Params, limbs: Sequence[_Limb]) -> int:
    """Every which sample is solved for."""
    if not limbs:
        return 1
    fastest = max(sample_preparation.fastest_turning(limb.read) for limb in limbs)
    read = limbs[0].read
    return min(
        multi_resolution.thinning(read.dt, max(params.least_rate, SAMPLES_A_PERIOD * fastest)),
        max(1, len(read) // LEAST_SAMPLES),
    )


def _calibrate_limb(
    params: Params,
    recording: Recording,
    limb: _Limb,
    every: int,
    progress: Callable[[float], None],
) -> Finger | None:
    """None where it was knocked, or came to no end, and samples were left out: all of them are needed."""
    noise = part_of(params, Noise)
    links, t, read = limb.links, limb.t, limb.read
    self_calibration_messages.require_movement(params, limb.name, read)
    guess = self_calibration_initialisation.initial_unknowns(
        links, noise, read, axis_in_sensors(links, recording.mounting, Z)
    )
    problem = with_lengths(
        build_problem(links, noise, read, guess.q_GS[0], recording.hand, recording.mounting),
        recording.geometry.lengths,
    )
    problem = multi_resolution.thin_problem(
        multi_resolution.average_accelerations(problem, every), every
    )
    t = t[::every][: len(problem)]
    found = solver.solve_with_noise(
        problem,
        multi_resolution.thin_unknowns(guess, every),
        Limits(),
        lambda k, cost: _report_progress(progress, min(0.9, k / 25)),
        sample_preparation.is_free(
            held_contacts(recording.events),
            t,
            read.gyr[::every][: len(t)],
            np.radians(params.hand_moving),
        ),
    )
    if every > 1 and (found.outcome == "not converged" or found.outliers):
        return None
    samples = monte_carlo.kept_samples(len(t))
    drawn = (
        [*posterior.draw_places(found.problem, found.at, found.factor, DRAWS, samples)]
        if found.outcome == "converged"
        else []
    )
    # before halves of it are solved: its factor is most of what is in memory
    found = replace(found, factor=normal_equations.keep_covariance_only(found.factor.covariance))
    self_calibration_messages.require_one_minimum(params, limb.name, read, found, float(t[0]))
    described = _describe(params, recording, limb.name, t, found, drawn)
    self_calibration_messages.require_possible(described)
    return described


@freed_memory_returned()
def _together(
    params: Params, recording: Recording, alone: list[Finger], progress: Callable[[float], None]
) -> tuple[list[Finger], list[str]]:
    """Solve all fingers as one problem with the hand and its soft tissue; without convergence the single solutions stay."""
    noise = part_of(params, Noise)
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
    samples = monte_carlo.kept_samples(len(found.problem))
    drawn = zip(*whole_hand_solver.draw_places(found, DRAWS, samples))
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
    """Scales of the priors on turn, slide and non-linearity of the skin under the fingers' sensors.

    The mean of squared estimate and posterior variance is the most likely prior variance (the M step
    of Dempster, Laird & Rubin 1977); where the movement gives no information the scale stays 1.
    """
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
