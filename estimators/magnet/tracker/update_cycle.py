"""One sample after the other: time update, magnetometers, accelerometers, standstill, volume; what is unexpected makes the filter careful.

Source  Kortier, thesis ch. 5, Fig. 5.3, (5.18); what inertial readings tell besides: magnet_inertial.py
"""

import math

import numpy as np

from handscope.estimators.magnet.model.dipole import MU0_4PI
from handscope.estimators.magnet.tracker.history import Trace, alone, beside, foreseen, told_of
from handscope.estimators.magnet.tracker.inertial_updates import inertial
from handscope.estimators.magnet.tracker.latency import (
    TELLS,
    WAY,
    considered,
    dependence,
    settled,
    went_on,
)
from handscope.estimators.magnet.tracker.magnetic_update import (
    EVIDENCE,
    answered,
    compared,
    kept,
    led,
    magnetometers,
    read,
    searched,
    sought,
)
from handscope.estimators.magnet.tracker.state import (
    B_,
    LEV,
    MOM,
    OWN,
    P_,
    SEATED,
    TH,
    THG,
    V_,
    VB,
    XB,
    XL,
    XM,
    XQ,
    XS,
    Sizes,
    corrected,
    moved,
    pushed,
    rates,
    stepped,
    widened,
)
from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.kalman import correct, explained
from handscope.estimators.numerics.kernels import multiply_matrices, rotation_matrix, skew
from handscope.estimators.numerics.small_matrices import block, put, spread
from handscope.estimators.numerics.typing import Array

WIDE = 0.06  # m: a place less sure than this is searched for in the whole volume
GATE = 5.0  # normalised innovation squared a degree of freedom from which a reading is left out
AUDIBLE, LOUD = (
    1.0,
    3.0,
)  # times what calibrations leave and a single reading's noise: what a known place is kept by, and what a lost one is found by
BENDS = 12.0  # a dipole's field over the square of its distance: its second derivative along the line to it
SLIGHT = 0.05  # share of a reading's variance that changes nothing
LASTS = 1.0  # s for which the field of a magnet stays alike that is not heard well enough to be followed
STRAIGHT = 0.3  # of the distance to the nearest magnetometer: a place known no better is not learnt from readings
FOUND = 0.15  # of that distance: a lost one known no better is not found
MEMORY, COUNTED = (
    0.5,
    0.1,
)  # s over which surprises are averaged; for which one reading counts at most, however long there was none
LOST = 3.0  # mean normalised innovation squared at which the place is given up: no chance over half a second
TURN_LOST = 20 * math.pi / 180
ROAMED = 600.0  # s over which it is looked how far the field differs from place to place
SURPRISE, OUT, SILENT = (
    0,
    1,
    2,
)  # rows of the mood: mean surprise, s since it is too large, s without a reading that was looked at
SINCE, MEAN, SQUARE = (
    3,
    4,
    6,
)  # s that were looked at, mean and mean squared deviation (T) of the field's other two components
UNTIL = 8  # s for which a hand out of earshot is not sought again
MOODS = 9
SEARCHED = 0.2  # s between searches that hear nothing


@inlined
def forgotten(s: Sizes, x: Array, P: Array, centre: Array, turn: float) -> None:
    """Where the hand is and how fast is not known any more; how it is turned is less sure."""
    for i in range(6):
        for j in range(len(P)):
            P[i, j] = P[j, i] = 0.0
    for i in range(3):
        P[P_ + i, P_ + i], P[V_ + i, V_ + i] = s.reach**2 / 3, s.reach_speed**2
        P[TH + i, TH + i] += turn**2
        x[P_ + i], x[V_ + i] = centre[i], 0.0


@inlined
def surprise(s: Sizes, x: Array, P: Array, way: Array, mag: Array) -> float:
    """Normalised innovation squared of the magnetometers' axes, a degree of freedom, of which some must have answered."""
    rows = 3 * len(mag)
    H, missed, noise = np.zeros((rows, len(P))), np.zeros(rows), np.zeros((rows, rows))
    compared(s, x, way, mag, 1.0 + bent(x, P) / s.mag**2, H, missed, noise)
    out: float = explained(
        P, missed, H, noise, np.empty((rows, len(P))), np.empty(len(P))
    ) / answered(mag)
    return out


@inlined
def heard(
    s: Sizes,
    x: Array,
    P: Array,
    way: Array,
    mag: Array,
    centre: Array,
    grown: float,
    dt: float,
    left: Array,
) -> Array:
    """The magnetic update in place: from where the filter is, and if it hardly knows, from where the readings point to. Gives the state, and fills left
    (3,): normalised innovation squared of all readings where it puts the hand, whether it was sought elsewhere, whether it is heard."""
    lost, disputed, less = P[0, 0] + P[1, 1] + P[2, 2] > WIDE**2, False, math.inf
    if lost:
        start, cost = led(
            s, x, P, way, np.zeros(len(P)), mag, 1.0, np.empty((3 * len(mag), len(P)))
        )
        there, less, disputed = best_of(s, x, P, way, searched(s, x, P, mag, centre), mag)
        if less < cost - EVIDENCE:  # what led astray would lead back
            found = moved(x, there)
            forgotten(s, x, P, found[0:3], 0.0)
            start, grown, left[1] = np.zeros(len(P)), 1.0, 1.0
        dx, C, cost = sought(s, x, P, way, start, mag, grown)
    else:
        dx, C, cost = kept(s, x, P, way, mag, grown)
        more = bent(moved(x, dx), C) * alike_for(C, dt) / s.mag**2
        if more > SLIGHT:
            dx, C, cost = kept(s, x, P, way, mag, grown + more)
    considered(way, P, dx, C)
    out: Array = moved(x, dx)
    left[0] = min(cost, less)
    known = (
        not disputed
        and cost < GATE * 3 * len(mag)
        and told(s, out, C, LOUD if lost else AUDIBLE, FOUND if lost else STRAIGHT)
    )
    left[2] = 1.0 if strength(out, distance(out)) > LOUD * s.single else 0.0
    if disputed and left[2] > 0.5:  # it is heard, but where it is will show as it moves
        out = x.copy()
    elif not known:
        out = without(s, x, P, way, mag, dt)
    else:
        put(C, P)
    return out


@inlined
def best_of(
    s: Sizes, x: Array, P: Array, way: Array, starts: Array, mag: Array
) -> tuple[Array, float, bool]:
    """Of places that starts (n, errors) lead to the one that explains the readings best, what it leaves, and whether another does nearly as well."""
    n = len(starts)
    ends, costs, best, disputed = np.empty(starts.shape), np.empty(n), 0, False
    W = np.empty((3 * len(mag), len(P)))
    for k in range(n):
        ends[k], costs[k] = led(s, x, P, way, starts[k], mag, 1.0, W)
        if costs[k] < costs[best]:
            best = k
    for k in range(n):
        apart = 0.0
        for i in range(3):
            apart += (ends[k, i] - ends[best, i]) ** 2
        disputed = disputed or (apart > WIDE**2 and costs[k] < costs[best] + EVIDENCE)
    return ends[best], costs[best], disputed


@inlined
def bent(x: Array, P: Array) -> float:
    """Variance, T^2, by which the field at a place that is not exactly known is not what its slope says."""
    away = distance(x)
    by_place: float = (
        BENDS
        * strength(x, away)
        / away**2
        * (P[P_, P_] + P[P_ + 1, P_ + 1] + P[P_ + 2, P_ + 2])
        / 3
    )
    return by_place**2 / 2  # of (e^2 - E e^2) / 2 the variance is half the square of e's


@inlined
def alike_for(P: Array, dt: float) -> float:
    """Readings dt s apart in which a place errs alike: for what it errs by over how fast it errs. As white noise what is bent counts so many times; without
    that readings seem to tell what none of them does."""
    place, speed = 0.0, 0.0
    for i in range(3):
        place, speed = place + P[P_ + i, P_ + i], speed + P[V_ + i, V_ + i]
    return max(1.0, math.sqrt(place / speed) / dt)


@inlined
def told(s: Sizes, x: Array, P: Array, audible: float, straight: float) -> bool:
    """Whether readings tell where the magnet is: known better than a share of its distance, for the dipole bends over what is not known and standard
    deviations from its slope would say nothing; and heard over what calibrations leave, which does not get less by waiting."""
    nearest, J, known = distance(x), np.zeros((3, LEV + 3)), np.empty((3, 3))
    loud, R = strength(x, nearest), rotation_matrix(x[XQ : XQ + 4])
    for i in range(3):
        J[i, P_ + i] = 1.0
    block(1.0, R, 0, LEV, J)
    block(-1.0, multiply_matrices(R, skew(x[XM + 3 : XM + 6])), 0, TH, J)
    spread(J, P, known)
    return bool(
        known[0, 0] + known[1, 1] + known[2, 2] < (straight * nearest) ** 2
        and loud**2 > audible**2 * s.single**2
    )


@inlined
def distance(x: Array) -> float:
    """From the hand's sensor to the nearest magnetometer, m."""
    nearest, many = math.inf, magnetometers(x)
    for k in range(many):
        first, square = XL + 3 * (many + k), 0.0
        for i in range(3):
            square += (x[i] - x[first + i]) ** 2
        nearest = min(nearest, square)
    return math.sqrt(nearest)


@inlined
def strength(x: Array, away: float) -> float:
    """Of the magnet's field beside it, T; on its axis it is twice that. (5.7)"""
    return MU0_4PI * math.sqrt(x[XM] ** 2 + x[XM + 1] ** 2 + x[XM + 2] ** 2) / max(away, 0.01) ** 3


@inlined
def without(s: Sizes, x: Array, P: Array, way: Array, mag: Array, dt: float) -> Array:
    """The update of a trunk whose magnet is out of reach, in place: the room's field alone, the magnet's an error that lasts `LASTS`: as white noise it
    would soon be learnt as the room's field. Gives the state; nothing where that does not fit either."""
    H, h, far = np.zeros((3 * len(mag), len(P))), np.zeros((3, len(P))), x.copy()
    missed, noise, dx, C = np.zeros(len(H)), np.zeros((len(H), len(H))), np.empty(len(P)), P.copy()
    for i in range(3):
        far[XM + i] = 0.0
    own = (
        4 * min(strength(x, distance(x)) ** 2, LOUD**2 * s.single**2) * max(1.0, LASTS / dt)
    )  # louder, it would have been found
    for k in range(len(mag)):
        reads = read(far, way, k, h)
        there = not math.isnan(mag[k, 0] + mag[k, 1] + mag[k, 2])
        for i in range(3):
            row = 3 * k + i
            noise[row, row], missed[row] = s.single**2 + own, mag[k, i] - reads[i] if there else 0.0
            for j in range(len(P)):
                H[row, j] = (
                    h[i, j] if there and (j < P_ + 3 or j >= TH) and not MOM <= j < MOM + 3 else 0.0
                )
    if correct(C, missed, H, noise, dx) > GATE * len(H):
        return x
    put(C, P)
    out: Array = moved(x, dx)
    return out


@inlined
def bounded(s: Sizes, x: Array, P: Array, centre: Array, dt: float) -> Array:
    """An arm is not endless and not endlessly fast: where the magnet does not tell, this keeps the filter in its volume. (5.18)"""
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
            corrected(P, dx, H, centre[i] - x[i], s.reach**2 / 3 / dt)  # once a second
        if outside or P[V_ + i, V_ + i] > s.reach_speed**2:
            for j in range(size):
                H[j] = 0.0
            H[V_ + i] = 1.0
            corrected(P, dx, H, -x[3 + i], s.reach_speed**2 * s.alike / dt)
    for i in range(
        6, size
    ):  # a wish, no measurement: nothing but place and velocity learns from it
        dx[i] = 0.0
        for j in range(6, size):
            P[i, j] = before[i, j]
    out: Array = moved(x, dx)
    return out


@inlined
def roamed(mood: Array, x: Array, dt: float) -> float:
    """How much the field differs from place to place, T: by its two components that readings and gravity tell. The mood in place."""
    mood[SINCE] = min(mood[SINCE] + dt, ROAMED)
    square, share = 0.0, dt / mood[SINCE]
    for i in range(2):
        off = x[XB + 1 + i] - mood[MEAN + i]
        mood[MEAN + i] += share * off
        mood[SQUARE + i] += share * ((1.0 - share) * off * off - mood[SQUARE + i])
        square += 0.5 * mood[SQUARE + i]
    return math.sqrt(square)


@looped
def followed(
    s: Sizes,
    centre: Array,
    x: Array,
    P: Array,
    mood: Array,
    before: Array,
    way: Array,
    dts: Array,
    samples: Array,
    mags: Array,
    ages: Array,
    still: Array,
    states: Array,
    variances: Array,
    moods: Array,
    trace: Trace,
) -> Array:
    """Go through samples (n, 12), magnetometers (n, magnetometers, 3) in the base's axes, how old these are (n, magnetometers), standstill (n, 2); fill
    states (n, ...), variances (n, ...), surprise (n,), and the trace if it has rows. P, mood, `before` (the last good readings) and `way` in place; gives
    the state."""
    F, now, left, own, lasting = (
        np.zeros((OWN, OWN)),
        np.zeros(12),
        np.zeros(3),
        np.empty((OWN, OWN)),
        np.empty((OWN, OWN)),
    )
    traced = len(trace.state) > 0
    if traced:
        beside(P, own, lasting)
    for n in range(len(samples)):
        dt, rough, v = dts[n], 1.0, x[3:6].copy()
        left[1] = 0.0 if 0 < dt <= s.max_gap else 1.0
        for i in range(12):
            now[i] = samples[n, i]
            if math.isnan(now[i]):
                now[i], rough = before[i], 1e4
        if dt > s.max_gap:
            forgotten(s, x, P, centre, 1.5 * TURN_LOST)
            for i in range(3):
                P[THG + i, THG + i] += TURN_LOST**2
                P[VB + i, VB + i] += s.trunk_speed**2
        elif dt > 0:
            x = stepped(s, x, before, now, dt, F)
            w_b, w_t = rates(x, now)
            F[B_, B_] = math.exp(
                -w_b * dt / s.left_alike
            )  # g is turned so that the field has nothing across itself, on the whole
            x[XB] *= F[B_, B_]
            for i in range(
                3 * len(mags[n])
            ):  # what calibrations left becomes another, and nothing is known of that
                x[XL + i] *= F[B_, B_]
            for i in range(5):
                x[XS + i] *= math.exp(-dt / SEATED)
            widened(
                s,
                P,
                F,
                dt,
                w_b,
                w_t,
                pushed(s, x, now),
                max(s.field_across, roamed(mood, x, dt)),
                rough,
            )
        if traced:
            foreseen(trace, n, x, P, F, own, lasting)
        went_on(way, now, dt if 0 < dt <= s.max_gap else 0.0)
        settled(way, x, P, v, dt if 0 < dt <= s.max_gap else 0.0)
        for i in range(12):
            before[i] = now[i]
        for k in range(len(mags[n])):
            way[WAY + k] = ages[n, k]
        step = min(max(dt, 1e-3), s.max_gap)
        wide = P[0, 0] + P[1, 1] + P[2, 2] > WIDE**2
        way[TELLS] = dependence(way, P, wide)
        mood[UNTIL] = mood[UNTIL] - step if wide else 0.0
        count = answered(mags[n]) if mood[UNTIL] <= 0.0 else 0
        if count:
            new = 0.0 if wide else surprise(s, x, P, way, mags[n])
            since = min(mood[SILENT] + step, 0.2)
            mood[SILENT] = 0.0
            if new < GATE or wide:
                x = heard(
                    s, x, P, way, mags[n], centre, max(1.0, mood[SURPRISE] / s.doubt), since, left
                )
            if wide:  # before it was found nothing could be expected: what no place explains is a surprise
                new, mood[UNTIL] = left[0] / count, SEARCHED * (1.0 - left[2])
            mood[SURPRISE] += min(since, COUNTED) / MEMORY * (min(new, 100.0) - mood[SURPRISE])
            mood[OUT] = mood[OUT] + since if mood[SURPRISE] > LOST else 0.0
            if mood[OUT] > MEMORY:
                forgotten(s, x, P, centre, TURN_LOST)
                mood[OUT], left[1] = 0.0, 1.0
        else:
            mood[SILENT] += step
        if rough < 2.0:
            x = inertial(s, x, P, now, still[n, 0] > 0.5, still[n, 1] > 0.5, wide, step)
        x = bounded(s, x, P, centre, step)
        for i in range(len(P)):
            for j in range(i):
                mean = 0.5 * (P[i, j] + P[j, i])
                P[i, j] = P[j, i] = mean
            variances[n, i] = P[i, i] * max(1.0, mood[SURPRISE] / s.doubt)
        for i in range(len(x)):
            states[n, i] = x[i]
        moods[n] = mood[SURPRISE]
        if traced:
            if left[1] > 0.5:
                alone(trace, n, own)
            told_of(trace, n, x, P, own, lasting)
    return x
