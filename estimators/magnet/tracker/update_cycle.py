"""The filter's loop over samples: propagation, magnetometers, accelerometers, standstill,
workspace; compiled.

Source  Kortier, thesis ch. 5, Fig. 5.3, (5.18)
"""

import math

import numpy as np

from handscope.estimators.magnet.tracker.history import (
    Trace,
    decouple_sample,
    split_covariance,
    store_prediction,
    store_update,
)
from handscope.estimators.magnet.tracker.inertial_updates import inertial_update
from handscope.estimators.magnet.tracker.latency import (
    KINEMATICS_SIZE,
    LATENCY_MODE,
    latency_mode,
    predict_kinematics,
    schmidt_update,
    smooth_velocity,
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
    predict_delayed_reading,
)
from handscope.estimators.magnet.tracker.monitor import (
    LOST_NIS,
    LOST_SD,
    LOST_TIME,
    LOST_TURN_SD,
    MAX_SD_SHARE,
    MAX_SD_SHARE_LOST,
    MEAN_NIS,
    MIN_SIGNAL,
    MIN_SIGNAL_LOST,
    NIS_GATE,
    SEARCH_DELAY,
    SILENT_TIME,
    compute_nis,
    error_correlation_samples,
    field_inhomogeneity,
    field_strength,
    is_observable,
    linearisation_variance,
    nearest_distance,
    reset_position,
)
from handscope.estimators.magnet.tracker.state import (
    B_,
    GRADIENT_TIME,
    MOM,
    OWN,
    P_,
    TH,
    THG,
    V_,
    VB,
    XB,
    XG,
    XL,
    XM,
    NoiseModel,
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
from handscope.estimators.numerics.typing import Array

NEGLIGIBLE_SHARE = 0.05  # share of a reading's variance that changes nothing
FIELD_ERROR_TIME = 1.0  # s, correlation time of the field of an untracked magnet
MEMORY = 0.5  # s over which NIS is averaged
MAX_COUNTED_TIME = 0.1  # s that one reading counts at most
SEARCH_INTERVAL = 0.2  # s between searches without signal


@inlined
def magnetic_update(
    s: NoiseModel,
    x: Array,
    P: Array,
    kinematics: Array,
    mag: Array,
    centre: Array,
    variance_scale: float,
    dt: float,
    outcome: Array,
) -> Array:
    """Magnetic update in place, from the filter's position or, if that is lost, from where the
    readings point. Returns the state; fills outcome (3,): NIS of all readings, whether the hand was
    relocated, whether it is detected."""
    lost, disputed, candidate_cost = P[0, 0] + P[1, 1] + P[2, 2] > LOST_SD**2, False, math.inf
    if lost:
        start, cost = gauss_newton_from(
            s, x, P, kinematics, np.zeros(len(P)), mag, 1.0, np.empty((3 * len(mag), len(P)))
        )
        candidate, candidate_cost, disputed = best_candidate(
            s, x, P, kinematics, candidate_positions(s, x, P, mag, centre), mag
        )
        if candidate_cost < cost - EVIDENCE:  # a wrong prior would lead back
            restarted = inject_error(x, candidate)
            reset_position(s, x, P, restarted[0:3], 0.0)
            start, variance_scale, outcome[1] = np.zeros(len(P)), 1.0, 1.0
        dx, C, cost = global_update(s, x, P, kinematics, start, mag, variance_scale)
    else:
        dx, C, cost = iterated_update(s, x, P, kinematics, mag, variance_scale)
        more = (
            linearisation_variance(inject_error(x, dx), C)
            * error_correlation_samples(C, dt)
            / s.mag**2
        )
        if more > NEGLIGIBLE_SHARE:
            dx, C, cost = iterated_update(s, x, P, kinematics, mag, variance_scale + more)
    schmidt_update(kinematics, P, dx, C)
    out: Array = inject_error(x, dx)
    outcome[0] = min(cost, candidate_cost)
    known = (
        not disputed
        and cost < NIS_GATE * 3 * len(mag)
        and is_observable(
            s,
            out,
            C,
            MIN_SIGNAL_LOST if lost else MIN_SIGNAL,
            MAX_SD_SHARE_LOST if lost else MAX_SD_SHARE,
        )
    )
    outcome[2] = (
        1.0 if field_strength(out, nearest_distance(out)) > MIN_SIGNAL_LOST * s.single else 0.0
    )
    if disputed and outcome[2] > 0.5:  # detected, but ambiguous until it moves
        out = x.copy()
    elif not known:
        out = update_without_magnet(s, x, P, kinematics, mag, dt)
    else:
        put(C, P)
    return out


@inlined
def best_candidate(
    s: NoiseModel, x: Array, P: Array, kinematics: Array, starts: Array, mag: Array
) -> tuple[Array, float, bool]:
    """Of the solutions from starts (n, errors) the best, its cost, and whether another is nearly as
    good."""
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
    return ends[best], costs[best], disputed


@inlined
def update_without_magnet(
    s: NoiseModel, x: Array, P: Array, kinematics: Array, mag: Array, dt: float
) -> Array:
    """Update with the ambient field alone, in place, the magnet's field a correlated error of
    `FIELD_ERROR_TIME`: as white noise it would soon be estimated as ambient. Returns the state;
    unchanged where that does not fit either."""
    H, h, far = np.zeros((3 * len(mag), len(P))), np.zeros((3, len(P))), x.copy()
    innovation, noise, dx, C = (
        np.zeros(len(H)),
        np.zeros((len(H), len(H))),
        np.empty(len(P)),
        P.copy(),
    )
    for i in range(3):
        far[XM + i] = 0.0
    own = (
        4
        * min(field_strength(x, nearest_distance(x)) ** 2, MIN_SIGNAL_LOST**2 * s.single**2)
        * max(1.0, FIELD_ERROR_TIME / dt)
    )  # a stronger one would have been located
    for k in range(len(mag)):
        reads = predict_delayed_reading(far, kinematics, k, h)
        there = not math.isnan(mag[k, 0] + mag[k, 1] + mag[k, 2])
        for i in range(3):
            row = 3 * k + i
            noise[row, row], innovation[row] = (
                s.single**2 + own,
                mag[k, i] - reads[i] if there else 0.0,
            )
            for j in range(len(P)):
                H[row, j] = (
                    h[i, j] if there and (j < P_ + 3 or j >= TH) and not MOM <= j < MOM + 3 else 0.0
                )
    if correct(C, innovation, H, noise, dx) > NIS_GATE * len(H):
        return x
    put(C, P)
    out: Array = inject_error(x, dx)
    return out


@inlined
def workspace_pseudo_measurement(
    s: NoiseModel, x: Array, P: Array, centre: Array, dt: float
) -> Array:
    """An arm's length and speed are bounded; keeps the filter in its workspace where the magnet
    does not. (5.18)"""
    size, before = len(P), P.copy()
    dx, H = np.zeros(size), np.zeros(size)
    outside = False
    for i in range(3):
        outside = outside or abs(x[i] - centre[i]) > s.reach
    for i in range(3):
        if P[P_ + i, P_ + i] > s.reach**2 / 3:
            for j in range(size):
                H[j] = 0.0
            H[P_ + i] = 1.0
            scalar_update(P, dx, H, centre[i] - x[i], s.reach**2 / 3 / dt)  # once a second
        if outside or P[V_ + i, V_ + i] > s.reach_speed**2:
            for j in range(size):
                H[j] = 0.0
            H[V_ + i] = 1.0
            scalar_update(P, dx, H, -x[3 + i], s.reach_speed**2 * s.acc_correlation_time / dt)
    for i in range(6, size):  # a bound, no measurement: only position and velocity are updated
        dx[i] = 0.0
        for j in range(6, size):
            P[i, j] = before[i, j]
    out: Array = inject_error(x, dx)
    return out


@looped
def run_filter(
    s: NoiseModel,
    centre: Array,
    x: Array,
    P: Array,
    monitor: Array,
    before: Array,
    kinematics: Array,
    dts: Array,
    samples: Array,
    mags: Array,
    ages: Array,
    still: Array,
    states: Array,
    variances: Array,
    mean_nis: Array,
    trace: Trace,
) -> Array:
    """Filter samples (n, 12) with magnetometers (n, magnetometers, 3) in base axes, their ages (n,
    magnetometers) and standstill (n, 2); fill states (n, ...), variances (n, ...), mean_nis (n,),
    and the trace if it has rows. P, monitor, `before` (last good readings) and kinematics are
    updated in place; returns the state."""
    F, now, outcome, own, lasting = (
        np.zeros((OWN, OWN)),
        np.zeros(12),
        np.zeros(3),
        np.empty((OWN, OWN)),
        np.empty((OWN, OWN)),
    )
    make_trace = len(trace.state) > 0
    if make_trace:
        split_covariance(P, own, lasting)
    for n in range(len(samples)):
        dt, noise_inflation, v = dts[n], 1.0, x[3:6].copy()
        outcome[1] = 0.0 if 0 < dt <= s.max_gap else 1.0
        for i in range(12):
            now[i] = samples[n, i]
            if math.isnan(now[i]):
                now[i], noise_inflation = before[i], 1e4
        if dt > s.max_gap:
            reset_position(s, x, P, centre, 1.5 * LOST_TURN_SD)
            for i in range(3):
                P[THG + i, THG + i] += LOST_TURN_SD**2
                P[VB + i, VB + i] += s.trunk_speed**2
        elif dt > 0:
            x = propagate_state(s, x, before, now, dt, F)
            w_b, w_t = turn_rates(x, now)
            F[B_, B_] = math.exp(-w_b * dt / s.mag_correlation_angle)  # g turns with the field
            x[XB] *= F[B_, B_]
            for i in range(3 * len(mags[n])):  # calibration residuals decorrelate
                x[XL + i] *= F[B_, B_]
            for i in range(5):
                x[XG + i] *= math.exp(-dt / GRADIENT_TIME)
            propagate_covariance(
                s,
                P,
                F,
                dt,
                w_b,
                w_t,
                specific_force_square(s, x, now),
                max(s.field_across, field_inhomogeneity(monitor, x, dt)),
                noise_inflation,
            )
        if make_trace:
            store_prediction(trace, n, x, P, F, own, lasting)
        predict_kinematics(kinematics, now, dt if 0 < dt <= s.max_gap else 0.0)
        smooth_velocity(kinematics, x, P, v, dt if 0 < dt <= s.max_gap else 0.0)
        for i in range(12):
            before[i] = now[i]
        for k in range(len(mags[n])):
            kinematics[KINEMATICS_SIZE + k] = ages[n, k]
        step = min(max(dt, 1e-3), s.max_gap)
        wide = P[0, 0] + P[1, 1] + P[2, 2] > LOST_SD**2
        kinematics[LATENCY_MODE] = latency_mode(kinematics, P, wide)
        monitor[SEARCH_DELAY] = monitor[SEARCH_DELAY] - step if wide else 0.0
        count = count_axes(mags[n]) if monitor[SEARCH_DELAY] <= 0.0 else 0
        if count:
            new = 0.0 if wide else compute_nis(s, x, P, kinematics, mags[n])
            since = min(monitor[SILENT_TIME] + step, 0.2)
            monitor[SILENT_TIME] = 0.0
            if new < NIS_GATE or wide:
                x = magnetic_update(
                    s,
                    x,
                    P,
                    kinematics,
                    mags[n],
                    centre,
                    max(1.0, monitor[MEAN_NIS] / s.nis_limit),
                    since,
                    outcome,
                )
            if wide:  # no prediction before it is located: the residual of the best position counts
                new, monitor[SEARCH_DELAY] = (
                    outcome[0] / count,
                    SEARCH_INTERVAL * (1.0 - outcome[2]),
                )
            monitor[MEAN_NIS] += (
                min(since, MAX_COUNTED_TIME) / MEMORY * (min(new, 100.0) - monitor[MEAN_NIS])
            )
            monitor[LOST_TIME] = monitor[LOST_TIME] + since if monitor[MEAN_NIS] > LOST_NIS else 0.0
            if monitor[LOST_TIME] > MEMORY:
                reset_position(s, x, P, centre, LOST_TURN_SD)
                monitor[LOST_TIME], outcome[1] = 0.0, 1.0
        else:
            monitor[SILENT_TIME] += step
        if noise_inflation < 2.0:
            x = inertial_update(s, x, P, now, still[n, 0] > 0.5, still[n, 1] > 0.5, wide, step)
        x = workspace_pseudo_measurement(s, x, P, centre, step)
        for i in range(len(P)):
            for j in range(i):
                mean = 0.5 * (P[i, j] + P[j, i])
                P[i, j] = P[j, i] = mean
            variances[n, i] = P[i, i] * max(1.0, monitor[MEAN_NIS] / s.nis_limit)
        for i in range(len(x)):
            states[n, i] = x[i]
        mean_nis[n] = monitor[MEAN_NIS]
        if make_trace:
            if outcome[1] > 0.5:
                decouple_sample(trace, n, own)
            store_update(trace, n, x, P, own, lasting)
    return x
