"""A sensor that was turned on its segment during the recording: its joints lie elsewhere in its frame afterwards.

In      pairs of sensors (sensor_pairs.py)
Out     which sensor, by what turn, from when on
Source  ours: a test for a break (Chow 1960, Econometrica 28:591) at several instants; a rigid turn moves all joints of a sensor together, skin slides them along the segment.
        A sensor that turns about itself accelerates nothing, whereas a segment that turned as its gyroscope says would accelerate its joints. Where they lie is told by
        the windows before and by those after: a turn moves them in the sensor's frame, and what all windows together tell would fit neither
Limits  a turn about the line from the sensor to its only joint is not seen; gentle movement does not tell places well enough. A turn that the gyroscope sees is found if it takes half a
        second or less and the hand moves gently meanwhile; at the last sensor of a finger only if the movement tells well where its joint lies
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours import common_joint, joint_windows
from handscope.estimators.fault_detection.neighbours.common_joint import Joint
from handscope.estimators.fault_detection.neighbours.other_joints import Others
from handscope.estimators.fault_detection.neighbours.sensor_pairs import NEAR, Pairs
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.tail_probabilities import chi2_sf, f_sf
from handscope.estimators.numerics.typing import Array

SPLITS = (0.2, 0.35, 0.5, 0.65, 0.8)  # of the recording
TOLERATED = 1.0e-3  # m, each axis, that skin may shift a joint between two movements; ours
MOST = np.radians(60.0)  # what turned further was not worn any more
TURN_SD = np.radians(30.0)
SUDDEN = 3.0  # times its noise a window leaves where a sensor may have been turned
HELD = 0.002  # weight against a turn about the vertical, which gravity does not show, in shares of that of gravity
LEAST_SURE = 0.01
# m of a joint's place and m/s^2 of a bias, by which readings before or after a window may tell them otherwise
FREE = np.repeat((NEAR, common_joint.ACC_BIAS), 3)
LEAST_PIECE = 6  # samples of a window, before and after
LEAST = np.radians(6.0)  # smaller turns are those of skin and of mounting
ODD = 1.2  # times what the recording's other joints let expect, and what its other windows leave, from which on a window may be asked whether the sensor turned in it
LENGTHS = (0.08, 0.15, 0.35)  # s, that a turn takes, about
FINER = (0.8, 0.9, 1.0, 1.1, 1.25)  # of such a length, twice
INSTANT = joint_windows.AVERAGED / joint_windows.RATE  # s
LEAST_INSTANTS = 12  # of a window that has gaps, in one piece
OF_SENSOR, ASKED = 2, 12  # windows of a sensor, and in all, that are asked: the oddest
STEPS, REFINED = 3, 2  # of the search for a turn, and of its course
SHIFTS = INSTANT / 4 * np.arange(-3, 4)  # s, of its begin
DIFFERENCE = 1e-3  # rad, for derivatives
SURE = 2e-7  # p-value of a turn that a gyroscope saw: flicks of fingers and keystrokes leave no white noise; of 258 intact recordings of two simulators the smallest of turns of LEAST to MOST was 1.8e-5
SEEN = (
    0.5  # share of a turn that its gyroscope has to see: the segment may turn to and fro meanwhile
)
TAKEN = 0.2  # s of a turn of which a recording is asked whether it would show
SAMPLED = 6  # windows of it, evenly, that are asked
# times its noise that is left where a turn has spoilt what is known of a joint's place and of biases; size ours, of turns put into recordings
SPOILT = 4.0
OF_COURSE = 5  # numbers that tell a turn's course: its vector, begin and length


@dataclass(frozen=True)
class Slip:
    """A sensor that was turned."""

    sensor: str
    turn: Array  # (3,) rad, of its frame, in its frame
    start: float  # s, from when on
    p_value: float
    is_seen: bool = False  # by the sensor's own gyroscope

    @property
    def size(self) -> float:
        """Of the turn, rad."""
        return float(np.linalg.norm(self.turn))


def find(pairs: Pairs) -> Slip | None:
    """The most certain slip, with the probability of such a change without any."""
    begin, end = pairs.series.span
    if not pairs.joints:
        return None
    at = begin + np.array(SPLITS) * (end - begin)
    before = [pairs.joint_within(*j, (begin, t)) for t in at for j in pairs.joints]
    after = [pairs.joint_within(*j, (t, end)) for t in at for j in pairs.joints]
    turns, gains = _turned(pairs, before, after)
    split, sensor = np.unravel_index(int(np.argmax(gains)), gains.shape)
    turn = turns[split, sensor]
    if not LEAST < np.linalg.norm(turn) < MOST:
        return None
    p = float(chi2_sf(float(gains[split, sensor]), 3)) * gains.size
    return Slip(pairs.series.sensors[sensor], turn, float(at[split]), min(1.0, p))


def find_jump(pairs: Pairs) -> Slip | None:
    """A turn that the sensor's own gyroscope did not see, at once: before and after it the same joint needs two rotations between the sensors.

    So it looks where samples of the slip are lost, or where readings before and after were joined.
    """
    tests = 2 * pairs.series.count / joint_windows.RATE * len(pairs.series.sensors)
    found = [
        _jumped(each, sensor, tests)
        for each in (pairs, pairs.later)
        for sensor in pairs.series.sensors
    ]
    sure = [
        (slip, count)
        for slip, count in found
        if slip is not None
        and slip.p_value < LEAST_SURE
        and LEAST < np.linalg.norm(slip.turn) < MOST
    ]
    return max(sure, key=lambda s: (s[1], -s[0].p_value), default=(None, 0))[0]


def _jumped(pairs: Pairs, sensor: str, tests: float) -> tuple[Slip | None, int]:
    """The sensor's largest jump that all its joints show, and how many they are."""
    around = _joints_of(pairs, sensor)
    fits = [(j, pairs.joint(*j, j), pairs.whole(*j)) for j in around]
    if not fits:
        return None, 0
    ratio = np.min([np.where(use, f.rest / f.noise, 0.0) for _, f, use in fits], axis=0)
    k = int(np.argmax(ratio))
    if ratio[k] < SUDDEN:
        return None, 0
    jumps = [_jump(pairs, j, f, k) for j, f, _ in fits]
    turn = jumps[0][0] if around[0][1] == sensor else -jumps[0][0]
    return Slip(sensor, turn, jumps[0][1], min(1.0, max(p for _, _, p in jumps) * tests)), len(
        around
    )


def _jump(pairs: Pairs, joint: tuple[str, str], found: Joint, k: int) -> tuple[Array, float, float]:
    """The turn (3,) of the second sensor within window k that explains it best, when (s), and the probability of so much better a fit without one."""
    first, second = (pairs.windows(s) for s in joint)
    a = (first.force + first.arm @ found.place[:3])[k]
    b = (second.force + second.arm @ found.place[3:])[k]
    best = (np.zeros(3), 0.0, np.inf)
    for cut in range(LEAST_PIECE, len(a) - LEAST_PIECE):
        before = common_joint.aligned(a[:cut].T @ b[:cut])
        after = common_joint.aligned(a[cut:].T @ b[cut:] + HELD * np.sum(a[cut:] ** 2) * before)
        left = np.concatenate([a[:cut] - b[:cut] @ before.T, a[cut:] - b[cut:] @ after.T])
        rest = float((left**2).mean())
        if rest < best[2]:
            best = (
                quat.log(quat.from_matrix(before.T @ after)),
                float(first.t[k]) + cut * joint_windows.AVERAGED / joint_windows.RATE,
                rest,
            )
    turn, when, rest = best
    free = (
        len(a) - 2 - LEAST_PIECE
    )  # neighbouring samples err together: one of three axes' worth of freedom is counted
    ratio = (float(found.rest[k]) - rest) / 3 / (max(rest, float(found.noise[k])) / free)
    return turn, when, float(f_sf(ratio, 3, free))


def find_turning(pairs: Pairs, others: Others) -> Slip | None:
    """A turn within half a second that the sensor's own gyroscope saw: in one window its joints leave what a segment's turn would accelerate."""
    odd = [
        (ratio, k, each, sensor)
        for each in (pairs, pairs.later)
        for sensor in each.series.sensors
        if _joints_of(each, sensor)
        for ratio, k in _oddest(each, others, sensor)
        if ratio > ODD
    ]
    oddest = sorted(odd, key=lambda o: -o[0])[:ASKED]
    found = [_turning(each, others, sensor, k) for _, k, each, sensor in oddest]
    sure = [slip for slip in found if slip is not None and LEAST < slip.size < MOST]
    return min(sure, key=lambda slip: slip.p_value, default=None)


def _joints_of(pairs: Pairs, sensor: str) -> list[tuple[str, str]]:
    return [j for j in pairs.joints if sensor in j]


def _oddest(pairs: Pairs, others: Others, sensor: str) -> list[tuple[float, int]]:
    """How many times what other joints, and the sensor's own in other windows, let expect all its joints leave in the windows that leave most, and which those are."""
    ratios = _ratios(pairs, others, sensor)
    least = np.min([r / max(1.0, float(np.median(r))) for r in ratios], axis=0)
    return [(float(least[k]), int(k)) for k in np.argsort(-least)[:OF_SENSOR]]


def _ratios(pairs: Pairs, others: Others, sensor: str) -> list[Array]:
    """How many times what other joints let expect each of a sensor's joints leaves in every window (K,), as the other windows tell where it lies."""
    sizes, found = others.without(sensor), []
    for joint in _joints_of(pairs, sensor):
        fit, use = pairs.joint(*joint, joint), pairs.use(*joint)
        sums = _weighted_sums(fit, use, sizes.expected(fit.couple.parts))
        step = _step_by(sums.sum(axis=0) - sums, joint.index(sensor))
        found.append(np.einsum("ki,kij,kj->k", step, sums, step) / fit.couple.count)
    return found


def share_shown(pairs: Pairs, others: Others, sensor: str, turn: Array) -> float:
    """In what share of a recording's windows a turn (3,) rad of a sensor, in its frame and to either side within `TAKEN` s, would be told if its gyroscope saw it."""
    if len(_joints_of(pairs, sensor)) < 2:  # one joint that lies near hardly ever tells it
        return 0.0
    usual = [float(np.median(r)) for r in _ratios(pairs, others, sensor)]
    last = len(pairs.series.chosen) - 1
    asked = np.unique(np.linspace(0, last, SAMPLED).round().astype(int))
    found = [_shows(pairs, others, sensor, int(k), turn, usual) for k in asked]
    return float(np.mean(found))


def _shows(
    pairs: Pairs, others: Others, sensor: str, k: int, turn: Array, usual: Sequence[float]
) -> float:
    """Share of the two turns in the middle of window k that would be told; its joints leave `usual` times what is expected in other windows."""
    window = _Window.of(pairs, others, sensor, k)
    if window is None:
        return 0.0
    begin = np.full(2, 0.5 * (joint_windows.LENGTH - TAKEN))
    course = _Course.of(window.there, begin, np.full(2, TAKEN))
    ends = window.anywhen
    # readings of a sensor that did not turn, taken for those of one that did, leave what a turn leaves that is not known
    spoilt = np.mean([e.left(np.stack([turn, -turn]), course) ** 2 for e in ends], axis=3)
    odd = [
        s.mean(axis=1) > ODD * e * max(1.0, u) for s, e, u in zip(spoilt, window.expected, usual)
    ]
    left = _squares(ends)
    known = replace(window, noise=SPOILT * window.noise)
    sure = [known.p_value(w, left) < SURE for w in spoilt.mean(axis=0)]
    return float(np.mean(np.all(odd, axis=0) & sure))


@dataclass(frozen=True)
class _Window:
    """A sensor's joints in one window in which it may have turned, as they lie in all windows, in those before it and in those after it."""

    anywhen: list["_End"]
    before: list["_End"]
    after: list["_End"]
    there: NDArray[np.bool_]  # which of the window's instants all have, m of them
    expected: list[float]  # (m/s^2)^2, what the recording's other joints let expect of each
    noise: float  # (m/s^2)^2, what they usually leave
    weight: Array  # (m,) of the instants: less where samples do not tell how rates change
    tests: float  # turns that are tried in the recording

    @classmethod
    def of(cls, pairs: Pairs, others: Others, sensor: str, k: int) -> "_Window | None":
        """Window k; None where too few instants are there."""
        joints = _joints_of(pairs, sensor)
        fits = [pairs.joint(*joint, joint) for joint in joints]
        there = np.all([f.couple.first.weight[k] > 0 for f in fits], axis=0)
        m = int(there.sum())
        if m < LEAST_INSTANTS:
            return None
        sizes, ends, here, noise = others.without(sensor), [], [], []
        for joint, fit in zip(joints, fits):
            expected, use = sizes.expected(fit.couple.parts), pairs.use(*joint)
            sums = _weighted_sums(fit, use, expected)
            sides = [s.sum(axis=0) for s in (sums[:k], sums[k + 1 :])]
            steps = [_step_by(s, joint.index(sensor)) for s in (sum(sides), *sides)]
            left = sum(x @ s @ x for x, s in zip(steps[1:], sides)) / fit.couple.count
            here.append(float(expected[k]))
            noise.append(here[-1] * max(1.0, left / max(1, use.sum() - 1)))
            places = [fit.unknowns + x[:-1] for x in steps]
            ends.append([_End.of(pairs, joint, x, sensor, k, there) for x in places])
        anywhen, before, after = (list(e) for e in zip(*ends))
        count = 2 * len(pairs.series.sensors) * len(pairs.series.chosen)
        tests = count * len(LENGTHS) * m
        usual = float(np.mean(noise))
        neighbours = [j[1 - j.index(sensor)] for j in joints]
        between = _between_samples(pairs, neighbours, k)[there]
        weight = usual / (usual + between)
        return cls(anywhen, before, after, there, here, usual, weight, tests)

    def p_value_of(self, left: Array) -> float:
        """Of a turn that leaves mean squares (m,) `left`, wherever the joints lie without one."""
        return max(
            self.p_value(_squares(ends), left) for ends in (self.anywhen, self.before, self.after)
        )

    def p_value(self, without: Array, left: Array) -> float:
        """Of a turn that leaves mean squares (m,) `left` of those that are left `without` one."""
        m, without, left = len(without), self.weight * without, self.weight * left
        kept = np.arange(m) != np.argmax(without)  # a knock leaves much at one instant
        free = len(self.anywhen) * (m - 1) - OF_COURSE  # as in `_jump`: one of three axes' worth
        rest = float(left[kept].mean())
        less = float(without[kept].mean()) - rest
        ratio = less / OF_COURSE / (max(rest, self.noise) / free)
        return float(f_sf(ratio, OF_COURSE, free)) * self.tests


def _between_samples(pairs: Pairs, sensors: Sequence[str], k: int) -> Array:
    """Mean squares (instants,) (m/s^2)^2 that arms may add in window k beyond what derivatives between samples tell, as where a finger is stopped: of the worst of some sensors.

    Of a sensor's neighbours: a turn of its own within a few samples leaves them alone.
    """
    series, m = pairs.series, round(joint_windows.LENGTH * joint_windows.RATE)
    rows = np.minimum(int(series.chosen[k]) * m + np.arange(m), len(series.t) - 1)
    columns = [series.sensors.index(s) for s in sensors]
    doubt = series.doubt[rows][:, columns].max(axis=1).reshape(-1, joint_windows.AVERAGED)
    return np.asarray(common_joint.ARM**2 * (doubt**2).mean(axis=1))


def _weighted_sums(fit: Joint, use: NDArray[np.bool_], expected: Array) -> Array:
    """A joint's sums (K, 13, 13) of the windows that are used, over what is expected to be left in each (K,)."""
    return np.asarray(fit.sums * (use / expected)[:, None, None])


def _step_by(sums: Array, own: int) -> Array:
    """From a joint's unknowns to those (..., 13), followed by 1, that fit sums (..., 13, 13) best if its place in the frame of the sensor `own` (0 or 1), and that sensor's bias, are free; also where nothing turns."""
    free = np.r_[3 * own : 3 * own + 3, 6 + 3 * own : 9 + 3 * own]
    by = sums[..., free[:, None], free] + np.diag(1 / FREE**2)
    step = np.zeros(sums.shape[:-1])
    step[..., free] = -np.linalg.solve(by, sums[..., free, -1][..., None])[..., 0]
    step[..., -1] = 1.0
    return step


def _turning(pairs: Pairs, others: Others, sensor: str, k: int) -> Slip | None:
    """The sensor's turn in window k that explains best what its joints leave; None where a turn does no better than chance would."""
    window = _Window.of(pairs, others, sensor, k)
    if window is None or window.p_value_of(np.zeros(int(window.there.sum()))) > SURE:
        return None  # whatever the turn
    begins = np.arange(-INSTANT, joint_windows.LENGTH, INSTANT)
    begin, length = (v.ravel() for v in np.meshgrid(begins, LENGTHS))
    whole = begin + length <= joint_windows.LENGTH
    best = _fitted(window, np.zeros((int(whole.sum()), 3)), begin[whole], length[whole])
    for _ in range(REFINED):
        shift, factor = (v.ravel() for v in np.meshgrid(SHIFTS, FINER))
        turn = np.tile(best.turn, (len(shift), 1))
        best = _fitted(window, turn, best.begin + shift, best.length * factor)
    p, start = window.p_value_of(best.left), float(pairs.windows(sensor).t[k] + best.begin)
    found = Slip(sensor, best.turn, start, p, True)
    fastest = float(np.linalg.norm(pairs.windows(sensor).rate[k], axis=1).max())  # rad/s
    return found if p < SURE and fastest > SEEN * found.size / best.length else None


def _squares(ends: Sequence["_End"]) -> Array:
    """Mean squares (m,) that are left at each instant if nothing turned, (m/s^2)^2."""
    still = np.zeros((1, 3))
    course = _Course.of(ends[0].there, np.zeros(1), np.ones(1))
    return np.asarray(np.mean([e.left(still, course)[0] ** 2 for e in ends], axis=(0, 2)))


@dataclass(frozen=True)
class _Course:
    """How turns go on over the instants of a window: their share, and the derivatives of that by time."""

    share: Array  # (C, m)
    rate: Array  # (C, m) 1/s
    change: Array  # (C, m) 1/s^2

    @classmethod
    def of(cls, there: NDArray[np.bool_], begin: Array, length: Array) -> "_Course":
        """As cubics from 0 at `begin` (C,) to 1, `length` (C,) s later; means over each instant that is `there`, m of them."""
        at = np.arange(2 * len(there) + 1) * INSTANT / 2
        u = np.clip((at - begin[:, None]) / length[:, None], 0.0, 1.0)
        share = u**2 * (3 - 2 * u)
        rate = 6 * u * (1 - u) / length[:, None]
        steps = (np.diff(v[:, ::2], axis=1) / INSTANT for v in (share, rate))
        return cls(*(v[:, there] for v in (share[:, 1::2], *steps)))


@dataclass(frozen=True)
class _End:
    """One joint of a sensor in a window, at the m instants that are there: its acceleration by the neighbour, and what the sensor reads for it."""

    there: NDArray[np.bool_]  # which of the window's instants these are
    place: Array  # (3,) m, in the sensor's frame
    by_neighbour: Array  # (m, 3) m/s^2, in the neighbour's frame of the window
    force: Array  # (m, 3) m/s^2, in the sensor's, without the accelerometer's bias
    arm: Array  # (m, 3, 3) 1/s^2
    turned: Array  # (m, 3, 3)
    rate: Array  # (m, 3) rad/s

    @classmethod
    def of(
        cls,
        pairs: Pairs,
        joint: tuple[str, str],
        unknowns: Array,
        sensor: str,
        k: int,
        there: NDArray[np.bool_],
    ) -> "_End":
        found = unknowns.reshape(2, 2, 3)
        own, other = (0, 1) if joint[0] == sensor else (1, 0)
        seen, mine = pairs.windows(joint[other]), pairs.windows(sensor)
        by_neighbour = seen.force[k] + seen.arm[k] @ found[0, other]
        readings = (
            by_neighbour - seen.turned[k] @ found[1, other],
            mine.force[k] - mine.turned[k] @ found[1, own],
            mine.arm[k],
            mine.turned[k],
            mine.rate[k],
        )
        return cls(there, found[0, own], *(v[there] for v in readings))

    def left(self, turn: Array, course: _Course) -> Array:
        """What is left (C, m, 3) m/s^2 of the joint's acceleration if the sensor turned so (C, 3) on its segment, the rotation between the sensors being free."""
        by = turn[:, None]
        so_far = course.share[..., None] * by
        place = self.place - np.cross(so_far, self.place - 0.5 * np.cross(so_far, self.place))
        own = course.rate[..., None] * by  # rad/s, of the sensor against its segment
        change = course.change[..., None] * by + np.cross(self.rate, own)
        of_segment = np.cross(own, np.cross(own - self.rate, place))
        too_much = np.cross(change, place) + np.cross(self.rate, np.cross(own, place)) - of_segment
        seen = self.force + np.einsum("mij,cmj->cmi", self.arm, place)
        seen = seen - np.einsum("mij,cmj->cmi", self.turned, too_much)
        R = common_joint.aligned(self.by_neighbour.T @ seen)
        return np.asarray(self.by_neighbour - seen @ np.swapaxes(R, 1, 2))


@dataclass(frozen=True)
class _Fit:
    """A turn and what it leaves."""

    turn: Array  # (3,) rad
    begin: float  # s, in the window
    length: float  # s
    left: Array  # (m,) mean squares at each instant, (m/s^2)^2


def _fitted(window: _Window, turn: Array, begin: Array, length: Array) -> _Fit:
    """Of turns near some (C, 3) that go on so the one that explains most; small turns are as probable as TURN_SD says."""
    course = _Course.of(window.there, begin, length)
    prior = window.noise / TURN_SD**2

    def left(turn: Array) -> Array:
        every = [e.left(turn, course) for e in window.before]
        return np.stack(every, axis=2).reshape(len(turn), -1)

    def cost(turn: Array, e: Array) -> Array:
        return np.asarray((e**2).sum(axis=1) + prior * (turn**2).sum(axis=1))

    e = left(turn)
    for _ in range(STEPS):
        steps = DIFFERENCE * np.eye(3)
        by = np.stack([(left(turn + d) - e) / DIFFERENCE for d in steps], axis=-1)
        normal = np.swapaxes(by, 1, 2) @ by + prior * np.eye(3)
        right = (e[:, None] @ by)[:, 0] + prior * turn
        tried = turn - np.linalg.solve(normal, right[..., None])[..., 0]
        then = left(tried)
        less = (cost(tried, then) < cost(turn, e))[:, None]
        turn, e = np.where(less, tried, turn), np.where(less, then, e)
    best = int(np.argmin(cost(turn, e)))
    each = (e[best].reshape(len(course.share[0]), -1) ** 2).mean(axis=1)
    return _Fit(turn[best], float(begin[best]), float(length[best]), each)


def _turned(pairs: Pairs, before: Sequence[Joint], after: Sequence[Joint]) -> tuple[Array, Array]:
    """The turns (splits, S, 3) rad of each sensor that explain best how its joints moved in its frame, and by how much (splits, S), sum of squares, they do."""
    ends = [s for joint in pairs.joints for s in joint]
    is_of = np.array([[end == s for end in ends] for s in pairs.series.sensors], float)
    place, later = (
        np.array([j.place for j in js]).reshape(-1, len(ends), 3) for js in (before, after)
    )
    covariance = common_joint.place_covariances(before) + common_joint.place_covariances(after)
    own = np.stack([covariance[:, :3, :3], covariance[:, 3:, 3:]], axis=1)
    information = np.linalg.inv(own + TOLERATED**2 * np.eye(3)).reshape(*place.shape, 3)
    # a frame turned by a small rotation v sees the place r moved by r x v
    lever = quat.skew(place)
    by = np.swapaxes(lever, -1, -2) @ information
    normal = (is_of @ (by @ lever).reshape(*place.shape[:2], 9)).reshape(*place.shape[:1], -1, 3, 3)
    right = is_of @ (by @ (later - place)[..., None])[..., 0]
    turn = np.linalg.solve(normal + np.eye(3) / TURN_SD**2, right[..., None])[..., 0]
    return turn, (right * turn).sum(axis=-1)
