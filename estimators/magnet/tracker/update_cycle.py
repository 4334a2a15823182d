"""The filter's loop over samples: propagation, magnetometers, accelerometers, standstill,
workspace; compiled.

Source  Kortier, thesis ch. 5, Fig. 5.3, (5.18)
"""

import math
from typing import NamedTuple

import numpy as np

from handscope.estimators.magnet.tracker.history import (
    Trace,
    decouple_sample,
    split_covariance,
    store_prediction,
    store_update,
)
from handscope.estimators.magnet.tracker.inertial_updates import Standstill, inertial_update
from handscope.estimators.magnet.tracker.latency import (
    Kinematics,
    latency_mode,
    predict_kinematics,
    schmidt_update,
    smooth_velocity,
    with_latency_mode,
)
from handscope.estimators.magnet.tracker.magnetic_update import (
    EVIDENCE,
    candidate_positions,
    gauss_newton_from,
    global_update,
    iterated_update,
)
from handscope.estimators.magnet.tracker.measurement_model import (
    count_axes,
    magnetometers,
    predict_delayed_reading,
)
from handscope.estimators.magnet.tracker.monitor import (
    LOST_NIS,
    LOST_SD,
    LOST_TURN_SD,
    MIN_SIGNAL_LOST,
    NIS_GATE,
    InnovationMonitor,
    compute_nis,
    error_correlation_samples,
    field_inhomogeneity,
    field_strength,
    is_lost,
    is_observable,
    linearisation_variance,
    nearest_distance,
    reset_position,
    with_field,
    with_silence,
)
from handscope.estimators.magnet.tracker.state import (
    ERROR,
    GRADIENT_TIME,
    OWN,
    STATE,
    InertialInterval,
    Movement,
    NoiseModel,
    inertial_sample,
    inject_error,
    propagate_covariance,
    propagate_state,
    scalar_update,
    specific_force_square,
    turn_rates,
)
from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.kalman import correct
from handscope.estimators.numerics.small_matrices import put
from handscope.estimators.numerics.typing import Array, Bools

NEGLIGIBLE_SHARE = 0.05  # share of a reading's variance that changes nothing
FIELD_ERROR_TIME = 1.0  # s, correlation time of the field of an untracked magnet
MEMORY = 0.5  # s over which NIS is averaged
MAX_COUNTED_TIME = 0.1  # s that one reading counts at most
SILENT_INFLATION = 1e4  # factor on the noise of sensors of which one did not answer
SEARCH_INTERVAL = 0.2  # s between searches without signal


class FilterState(NamedTuple):
    """What the loop needs of the samples before. Arrays are updated in place, but for x."""

    x: Array  # (45 + 6 L,) state
    P: Array  # (43 + 6 L, 43 + 6 L) covariance of its errors
    newest: Array  # (12,) last good inertial readings
    kinematics: Kinematics
    monitor: InnovationMonitor


class FilterInputs(NamedTuple):
    """Of n samples."""

    dt: Array  # (n,) s since the sample before
    inertial: Array  # (n, 12) NaN where a sensor did not answer
    mag: Array  # (n, L, 3) T, base axes
    age: Array  # (n, L) s of the readings
    still: Bools  # (n, 2) base, target


class Sample(NamedTuple):
    """One sample."""

    interval: InertialInterval
    mag: Array  # (L, 3) T
    still: Standstill


class FilterOutputs(NamedTuple):
    """Of n samples, to be filled."""

    x: Array  # (n, 45 + 6 L)
    variance: Array  # (n, 43 + 6 L)
    mean_nis: Array  # (n,)
    trace: Trace  # for the smoother; without rows where nothing is smoothed


class Candidate(NamedTuple):
    """The best of several positions that readings point to."""

    dx: Array  # (errors,)
    cost: float  # normalised innovation squared
    is_disputed: bool  # another is nearly as good


class MagneticOutcome(NamedTuple):
    """Of an update by magnetometers."""

    cost: float  # normalised innovation squared of all readings
    is_relocated: bool
    is_detected: bool


@inlined
def magnetic_update(
    s: NoiseModel,
    x: Array,
    P: Array,
    kinematics: Kinematics,
    mag: Array,
    centre: Array,
    variance_scale: float,
    dt: float,
) -> tuple[Array, MagneticOutcome]:
    """Magnetic update in place, from the filter's position or, if that is lost, from where the
    readings point. Returns the state."""
    lost, is_relocated, candidate = is_lost(P), False, Candidate(x, math.inf, False)
    if lost:
        start, candidate, is_relocated = search_position(s, x, P, kinematics, mag, centre)
        scale = 1.0 if is_relocated else variance_scale
        dx, C, cost = global_update(s, x, P, kinematics, start, mag, scale)
    else:
        dx, C, cost = tracked_update(s, x, P, kinematics, mag, variance_scale, dt)
    schmidt_update(kinematics, P, dx, C)
    out: Array = inject_error(x, dx)
    fits = not candidate.is_disputed and cost < NIS_GATE * 3 * len(mag)
    is_detected = field_strength(out, nearest_distance(out)) > MIN_SIGNAL_LOST * s.single
    if candidate.is_disputed and is_detected:  # ambiguous until it moves
        out = x.copy()
    elif fits and is_observable(s, out, C, lost):
        put(C, P)
    else:
        out = update_without_magnet(s, x, P, kinematics, mag, dt)
    return out, MagneticOutcome(min(cost, candidate.cost), is_relocated, is_detected)


@inlined
def search_position(
    s: NoiseModel, x: Array, P: Array, kinematics: Kinematics, mag: Array, centre: Array
) -> tuple[Array, Candidate, bool]:
    """Error from which to update a lost position, the best candidate of the workspace, and whether
    the hand was relocated there: x and P forget the position before, a wrong prior that would lead
    back."""
    start, cost = gauss_newton_from(
        s, x, P, kinematics, np.zeros(len(P)), mag, 1.0, np.empty((3 * len(mag), len(P)))
    )
    candidate = best_candidate(s, x, P, kinematics, candidate_positions(s, x, P, mag, centre), mag)
    is_better = candidate.cost < cost - EVIDENCE
    if is_better:
        relocated = inject_error(x, candidate.dx)
        reset_position(s, x, P, relocated[0:3], 0.0)
        start = np.zeros(len(P))
    return start, candidate, is_better


@inlined
def tracked_update(
    s: NoiseModel,
    x: Array,
    P: Array,
    kinematics: Kinematics,
    mag: Array,
    variance_scale: float,
    dt: float,
) -> tuple[Array, Array, float]:
    """Update of a known position; repeated with more noise where the field's second-order term
    counts."""
    dx, C, cost = iterated_update(s, x, P, kinematics, mag, variance_scale)
    more = (
        linearisation_variance(inject_error(x, dx), C) * error_correlation_samples(C, dt) / s.mag**2
    )
    if more > NEGLIGIBLE_SHARE:
        dx, C, cost = iterated_update(s, x, P, kinematics, mag, variance_scale + more)
    return dx, C, cost


@inlined
def best_candidate(
    s: NoiseModel, x: Array, P: Array, kinematics: Kinematics, starts: Array, mag: Array
) -> Candidate:
    """Of the solutions from starts (n, errors) the best."""
    n = len(starts)
    ends, costs, best, disputed = np.empty(starts.shape), np.empty(n), 0, False
    W = np.empty((3 * len(mag), len(P)))
    for k in range(n):
        ends[k], costs[k] = gauss_newton_from(s, x, P, kinematics, starts[k], mag, 1.0, W)
        if costs[k] < costs[best]:
            best = k
    for k in range(n):
        separation = 0.0
        for i in range(3):
            separation += (ends[k, i] - ends[best, i]) ** 2
        disputed = disputed or (separation > LOST_SD**2 and costs[k] < costs[best] + EVIDENCE)
    return Candidate(ends[best], costs[best], disputed)


@inlined
def update_without_magnet(
    s: NoiseModel, x: Array, P: Array, kinematics: Kinematics, mag: Array, dt: float
) -> Array:
    """Update with the ambient field alone, in place, the magnet's field a correlated error of
    `FIELD_ERROR_TIME`: as white noise it would soon be estimated as ambient. Returns the state;
    unchanged where that does not fit either."""
    rows = 3 * len(mag)
    H, innovation, noise = np.zeros((rows, len(P))), np.zeros(rows), np.zeros((rows, rows))
    ambient_innovations(x, kinematics, mag, H, innovation)
    own = (
        4
        * min(field_strength(x, nearest_distance(x)) ** 2, MIN_SIGNAL_LOST**2 * s.single**2)
        * max(1.0, FIELD_ERROR_TIME / dt)
    )  # a stronger one would have been located
    for row in range(rows):
        noise[row, row] = s.single**2 + own
    dx, C = np.empty(len(P)), P.copy()
    if correct(C, innovation, H, noise, dx) > NIS_GATE * len(H):
        return x
    put(C, P)
    out: Array = inject_error(x, dx)
    return out


@inlined
def ambient_innovations(
    x: Array, kinematics: Kinematics, mag: Array, H: Array, innovation: Array
) -> None:
    """Fill innovations and Jacobian of readings of a state without its magnet; zeros where a
    magnetometer did not answer."""
    h, far = np.zeros((3, H.shape[1])), x.copy()
    for i in range(3):
        far[STATE.moment + i] = 0.0
    for k in range(len(mag)):
        reads = predict_delayed_reading(far, kinematics, k, h)
        there = not math.isnan(mag[k, 0] + mag[k, 1] + mag[k, 2])
        for i in range(3):
            row = 3 * k + i
            innovation[row] = mag[k, i] - reads[i] if there else 0.0
            for j in range(H.shape[1]):
                H[row, j] = (
                    h[i, j]
                    if there
                    and (j < ERROR.p_bt + 3 or j >= ERROR.th_bt)
                    and not ERROR.moment <= j < ERROR.moment + 3
                    else 0.0
                )


@inlined
def workspace_pseudo_measurement(
    s: NoiseModel, x: Array, P: Array, centre: Array, dt: float
) -> Array:
    """An arm's length and speed are bounded; keeps the filter in its workspace where the magnet
    does not. (5.18)"""
    size, before = len(P), P.copy()
    dx, H, outside = np.zeros(size), np.zeros(size), False
    for i in range(3):
        outside = outside or abs(x[i] - centre[i]) > s.reach
    for i in range(3):
        if P[ERROR.p_bt + i, ERROR.p_bt + i] > s.reach**2 / 3:
            H[ERROR.p_bt + i] = 1.0
            scalar_update(P, dx, H, centre[i] - x[i], s.reach**2 / 3 / dt)  # once a second
            H[ERROR.p_bt + i] = 0.0
        if outside or P[ERROR.v_bt + i, ERROR.v_bt + i] > s.reach_speed**2:
            H[ERROR.v_bt + i] = 1.0
            scalar_update(
                P, dx, H, -x[STATE.v_bt + i], s.reach_speed**2 * s.acc_correlation_time / dt
            )
            H[ERROR.v_bt + i] = 0.0
    for i in range(6, size):  # a bound, no measurement: only position and velocity are updated
        dx[i] = 0.0
        for j in range(6, size):
            P[i, j] = before[i, j]
    out: Array = inject_error(x, dx)
    return out


@inlined
def next_interval(inputs: FilterInputs, n: int, newest: Array, row: Array) -> InertialInterval:
    """From the newest good readings to sample n, whose readings fill a row (12,); where a sensor
    did not answer, its newest ones do."""
    inflation = 1.0
    for i in range(12):
        row[i] = inputs.inertial[n, i]
        if math.isnan(row[i]):
            row[i], inflation = newest[i], SILENT_INFLATION
    return InertialInterval(inertial_sample(newest), inertial_sample(row), inputs.dt[n], inflation)


@inlined
def time_update(
    s: NoiseModel,
    centre: Array,
    x: Array,
    P: Array,
    F: Array,
    interval: InertialInterval,
    monitor: InnovationMonitor,
) -> tuple[Array, InnovationMonitor]:
    """Propagate over an interval: the state is returned, P and its Jacobian F change in place. A
    gap forgets position, velocities and headings."""
    dt = interval.dt
    if dt > s.max_gap:
        reset_position(s, x, P, centre, 1.5 * LOST_TURN_SD)
        for i in range(3):
            P[ERROR.th_gb + i, ERROR.th_gb + i] += LOST_TURN_SD**2
            P[ERROR.v_b + i, ERROR.v_b + i] += s.trunk_speed**2
    elif dt > 0:
        x = propagate_state(s, x, interval, F)
        w_b, w_t = turn_rates(x, interval.now)
        F[ERROR.B_g, ERROR.B_g] = math.exp(
            -w_b * dt / s.mag_correlation_angle
        )  # g turns with the field
        decorrelate_fields(x, F[ERROR.B_g, ERROR.B_g], dt)
        field, across = field_inhomogeneity(monitor.field, x, dt)
        square = specific_force_square(s, x, interval.now)
        movement = Movement(w_b, w_t, square, max(s.field_across, across), interval.noise_inflation)
        propagate_covariance(s, P, F, dt, movement)
        monitor = with_field(monitor, field)
    return x, monitor


@inlined
def decorrelate_fields(x: Array, share: float, dt: float) -> None:
    """Field across itself and calibrations, by what the trunk's turning leaves; gradients by time."""
    x[STATE.B_g] *= share
    for i in range(3 * magnetometers(x)):
        x[STATE.residuals + i] *= share
    for i in range(5):
        x[STATE.gradients + i] *= math.exp(-dt / GRADIENT_TIME)


@inlined
def follow_kinematics(
    s: NoiseModel,
    x: Array,
    P: Array,
    v: Array,
    kinematics: Kinematics,
    interval: InertialInterval,
    age: Array,
) -> Kinematics:
    """Kinematics with a sample; v (3,) is the velocity of the state before, x the state now."""
    dt = interval.dt if 0 < interval.dt <= s.max_gap else 0.0
    predict_kinematics(kinematics, interval.now, dt)
    smooth_velocity(kinematics, x, P, v, dt)
    for k in range(len(age)):
        kinematics.age[k] = age[k]
    out: Kinematics = with_latency_mode(kinematics, latency_mode(kinematics.motion, P, is_lost(P)))
    return out


@inlined
def measurement_update(
    s: NoiseModel,
    centre: Array,
    x: Array,
    P: Array,
    kinematics: Kinematics,
    sample: Sample,
    monitor: InnovationMonitor,
) -> tuple[Array, InnovationMonitor, bool]:
    """All updates from a sample's readings: state, monitor, and whether the hand was relocated; P
    in place."""
    interval, lost = sample.interval, is_lost(P)
    dt = min(max(interval.dt, 1e-3), s.max_gap)
    x, monitor, is_relocated = magnetometer_update(
        s, centre, x, P, kinematics, sample.mag, monitor, dt
    )
    if interval.noise_inflation < SILENT_INFLATION:
        x = inertial_update(s, x, P, interval.now, sample.still, lost, dt)
    x = workspace_pseudo_measurement(s, x, P, centre, dt)
    return x, monitor, is_relocated


@inlined
def magnetometer_update(
    s: NoiseModel,
    centre: Array,
    x: Array,
    P: Array,
    kinematics: Kinematics,
    mag: Array,
    monitor: InnovationMonitor,
    dt: float,
) -> tuple[Array, InnovationMonitor, bool]:
    """Update by the magnetometers that answered, unless they contradict a known position; without
    signal a lost one is searched for now and then."""
    lost, is_relocated = is_lost(P), False
    delay = monitor.search_delay - dt if lost else 0.0
    count = count_axes(mag) if delay <= 0.0 else 0
    if count == 0:
        return x, with_silence(monitor, dt, delay), False
    nis = 0.0 if lost else compute_nis(s, x, P, kinematics, mag)
    since = min(monitor.silent_time + dt, 0.2)
    if nis < NIS_GATE or lost:
        scale = max(1.0, monitor.mean_nis / s.nis_limit)
        x, outcome = magnetic_update(s, x, P, kinematics, mag, centre, scale, since)
        is_relocated = outcome.is_relocated
        if lost:  # no prediction before it is located: the residual of the best position counts
            nis, delay = outcome.cost / count, 0.0 if outcome.is_detected else SEARCH_INTERVAL
    mean, lost_time = average_nis(monitor, nis, since)
    if lost_time > MEMORY:
        reset_position(s, x, P, centre, LOST_TURN_SD)
        lost_time, is_relocated = 0.0, True
    return x, InnovationMonitor(mean, lost_time, 0.0, delay, monitor.field), is_relocated


@inlined
def average_nis(monitor: InnovationMonitor, nis: float, since: float) -> tuple[float, float]:
    """Mean of the normalised innovation squared with a reading that counts for `since` s, and for
    how long it has been too large, s."""
    mean = monitor.mean_nis
    mean += min(since, MAX_COUNTED_TIME) / MEMORY * (min(nis, 100.0) - mean)
    return mean, monitor.lost_time + since if mean > LOST_NIS else 0.0


@inlined
def store_outputs(
    outputs: FilterOutputs, n: int, x: Array, P: Array, mean_nis: float, nis_limit: float
) -> None:
    """Fill the outputs of sample n; P is made symmetric."""
    for i in range(len(P)):
        for j in range(i):
            mean = 0.5 * (P[i, j] + P[j, i])
            P[i, j] = P[j, i] = mean
        outputs.variance[n, i] = P[i, i] * max(1.0, mean_nis / nis_limit)
    for i in range(len(x)):
        outputs.x[n, i] = x[i]
    outputs.mean_nis[n] = mean_nis


@looped
def run_filter(
    s: NoiseModel, centre: Array, state: FilterState, inputs: FilterInputs, outputs: FilterOutputs
) -> FilterState:
    """Filter all samples; fill the outputs, and the trace if it has rows. `centre` (3,) is the
    workspace's, base axes. Returns the state after the last sample."""
    trace = outputs.trace
    x, P, kinematics, monitor = state.x, state.P, state.kinematics, state.monitor
    F, own, lasting = np.zeros((OWN, OWN)), np.empty((OWN, OWN)), np.empty((OWN, OWN))
    row, smoothed = np.zeros(12), len(trace.state) > 0
    if smoothed:
        split_covariance(P, own, lasting)
    for n in range(len(inputs.dt)):
        interval = next_interval(inputs, n, state.newest, row)
        v = x[STATE.v_bt : STATE.v_bt + 3].copy()
        x, monitor = time_update(s, centre, x, P, F, interval, monitor)
        if smoothed:
            store_prediction(trace, n, x, P, F, own, lasting)
        kinematics = follow_kinematics(s, x, P, v, kinematics, interval, inputs.age[n])
        for i in range(12):
            state.newest[i] = row[i]
        still = Standstill(inputs.still[n, 0], inputs.still[n, 1])
        sample = Sample(interval, inputs.mag[n], still)
        x, monitor, is_relocated = measurement_update(s, centre, x, P, kinematics, sample, monitor)
        store_outputs(outputs, n, x, P, monitor.mean_nis, s.nis_limit)
        if smoothed:
            if is_relocated or not 0 < inputs.dt[n] <= s.max_gap:
                decouple_sample(trace, n, own)
            store_update(trace, n, x, P, own, lasting)
    return FilterState(x, P, state.newest, kinematics, monitor)
