"""A sensor that was turned on its segment during the recording: its joints lie elsewhere in its frame afterwards.

In      pairs of sensors (sensor_pairs.py)
Out     which sensor, by what turn, from when on
Source  ours: a test for a break (Chow 1960, Econometrica 28:591) at several instants; a rigid turn moves all joints of a sensor together, skin slides them along the segment.
        A sensor that turns about itself accelerates nothing, whereas a segment that turned as its gyroscope says would accelerate its joints: likelihood ratio with places that are free in
        the window, near where the windows before and after it tell them, which a turn moves in the sensor's frame, and with noise of unknown size (Student's t)
Limits  a turn about the line from the sensor to its only joint is not seen; gentle movement does not tell places well enough. A turn that the gyroscope sees is found if it takes half a
        second or less; where all joints move briskly, each for itself, in half of the cases; at the last sensor of a finger only if the movement tells where its joint lies
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours import common_joint, joint_windows
from handscope.estimators.fault_detection.neighbours.common_joint import Joint
from handscope.estimators.fault_detection.neighbours.other_joints import Others
from handscope.estimators.fault_detection.neighbours.rates import isolated_turns
from handscope.estimators.fault_detection.neighbours.rates.isolated_turns import IsolatedTurn
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
FINER = (0.8, 1.0, 1.25)  # of such a length, twice
INSTANT = joint_windows.AVERAGED / joint_windows.RATE  # s
LEAST_INSTANTS = 12  # of a window that has gaps, in one piece
OF_SENSOR, ASKED = 2, 4  # windows of a sensor, and in all, that are asked: the oddest
ISOLATED = 10  # windows, the oddest, in which rates show a turn that neighbours' do not
STEPS, REFINED = 3, 2  # of the search for a turn, and of its course
SHIFTS = INSTANT / 4 * np.arange(-2, 3)  # s, of its begin
DIFFERENCE = 1e-3  # rad, for derivatives
MOVED = 1e-4  # m, for derivatives
AROUND = 0.1  # s, by which the middle of a turn may be off the one that rates show
SKIN_SHIFT = 1.5e-3  # m, each axis, that skin moves a joint's place between windows; ours
DEPENDENT = 6.0  # of what a window leaves, components by instants, one in so many counts: neighbouring samples and axes err together; ours
# times what the other joints let expect, and what is left without a turn: a window that leaves more than both is none that a turn explains; ours
UNEXPLAINED, HARDLY = 6.0, 0.1
CONVINCING = 6.0  # log likelihood ratio of a turn to none, which 1 in 20 of 188 intact recordings of two simulators reached somewhere ...
PROMISING = 9.0  # the same of the best turn that there could be, if it leaves what is usual, from which on one is looked for
COINCIDENT = 0.05  # ... and of 20 such windows none in which rates showed the turn as well
OFF = 0.5  # by which the share of a turn that the sensor's gyroscope sees beyond its neighbours' may differ from one; ours
TAKEN = 0.2  # s of a turn of which a recording is asked whether it would show
SAMPLED = 4  # windows of it, evenly, that are asked


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
    around = pairs.joints_of(sensor)
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
    """A turn within half a second that the sensor's own gyroscope saw, and its neighbours' did not: in one window its joints leave what a segment's turn would accelerate."""
    asked = [
        each
        for view in (pairs, pairs.later)
        for sensor in view.series.sensors
        if view.joints_of(sensor)
        for each in _suspected(view, others, sensor)
    ]
    isolated = [a for a in asked if a.seen is not None]
    odd = [a for a in asked if a.seen is None and a.ratio > ODD]
    found = [
        _turning(a, others)
        for some, most in ((isolated, ISOLATED), (odd, ASKED))
        for a in sorted(some, key=lambda a: -a.ratio)[:most]
    ]
    sure = [slip for slip in found if slip is not None and LEAST < slip.size < MOST]
    return min(sure, key=lambda slip: slip.p_value, default=None)


@dataclass(frozen=True)
class _Asked:
    """A window that is asked whether a sensor turned in it."""

    pairs: Pairs
    sensor: str
    window: int
    ratio: float  # of what its joints leave to what other joints, and they in other windows, let expect
    seen: IsolatedTurn | None = None  # by its rates


def _suspected(pairs: Pairs, others: Others, sensor: str) -> list[_Asked]:
    """Where a sensor's rates show a turn that its neighbours' do not, and where all its joints leave most while it turns."""
    ratios = _ratios(pairs, others, sensor)
    least = np.min([r / max(1.0, float(np.median(r))) for r in ratios], axis=0)
    turns = isolated_turns.find(pairs, sensor)
    found = [_Asked(pairs, sensor, t.window, float(least[t.window]), t) for t in turns]
    fastest = pairs.speed(sensor).max(axis=1)
    odd = np.where(fastest > OFF * LEAST / max(LENGTHS), least, 0.0)
    most = np.argsort(-odd)[:OF_SENSOR]
    return found + [_Asked(pairs, sensor, int(k), float(odd[k])) for k in most]


def _ratios(pairs: Pairs, others: Others, sensor: str) -> list[Array]:
    """How many times what other joints let expect each of a sensor's joints leaves in every window (K,), as the other windows tell where it lies."""
    sizes, found = others.without(sensor), []
    for joint in pairs.joints_of(sensor):
        fit, use = pairs.joint(*joint, joint), pairs.use(*joint)
        sums = _weighted_sums(fit, use, sizes.expected(fit.couple.parts))
        step = _step_by(sums.sum(axis=0) - sums, joint.index(sensor))
        found.append(np.einsum("ki,kij,kj->k", step, sums, step) / fit.couple.count)
    return found


def share_shown(pairs: Pairs, others: Others, sensor: str, turn: Array) -> float:
    """In what share of a recording's windows a turn (3,) rad of a sensor, in its frame and to one side or the other within `TAKEN` s, would be told if its gyroscope saw it."""
    if len(pairs.joints_of(sensor)) < 2:  # one joint that lies near hardly ever tells it
        return 0.0
    last = len(pairs.series.chosen) - 1
    asked = np.unique(np.linspace(0, last, SAMPLED).round().astype(int))
    turns = np.resize([1.0, -1.0], len(asked))[:, None] * turn
    return float(np.mean([_shows(pairs, others, sensor, int(k), t) for k, t in zip(asked, turns)]))


def _shows(pairs: Pairs, others: Others, sensor: str, k: int, turn: Array) -> bool:
    """Whether a turn in the middle of window k would be told: readings of a sensor that did not turn speak as much against it as those of one that did would for it."""
    window = _Window.of(pairs, others, sensor, k)
    if window is None:
        return False
    begin = np.full(1, 0.5 * (joint_windows.LENGTH - TAKEN))
    course = _Course.of(window.there, begin, np.full(1, TAKEN))
    return -window.evidence(turn, course) > CONVINCING


@dataclass(frozen=True)
class _Place:
    """Where a joint lies in a sensor's frame."""

    mean: Array  # (3,) m
    covariance: Array  # (3, 3) m^2

    def rotated(self, R: Array) -> "_Place":
        """The same in a frame to which R (3, 3) takes vectors."""
        return _Place(R @ self.mean, R @ self.covariance @ R.T)

    def combined(self, other: "_Place") -> tuple["_Place", float]:
        """What both tell of one place, and the normalised square of their difference."""
        gain = np.linalg.solve(self.covariance + other.covariance, self.covariance).T
        mismatch = other.mean - self.mean
        squared = mismatch @ np.linalg.solve(self.covariance + other.covariance, mismatch)
        covariance = self.covariance - gain @ self.covariance
        return _Place(self.mean + gain @ mismatch, covariance), float(squared)


@dataclass(frozen=True)
class _Window:
    """A sensor's joints in one window in which it may have turned."""

    ends: list["_End"]  # as they lie in the windows before it
    places: list[tuple[_Place, _Place]]  # as the windows before it tell them, and those after it
    there: NDArray[np.bool_]  # which of the window's instants all have, m of them
    expected: float  # (m/s^2)^2, what the recording's other joints let expect
    noise: float  # (m/s^2)^2, what they usually leave
    weight: Array  # (m,) of the instants: less where samples do not tell how rates change

    @classmethod
    def of(cls, pairs: Pairs, others: Others, sensor: str, k: int) -> "_Window | None":
        """Window k; None where too few instants are there."""
        joints = pairs.joints_of(sensor)
        fits = [pairs.joint(*joint, joint) for joint in joints]
        there = np.all([f.couple.first.weight[k] > 0 for f in fits], axis=0)
        m = int(there.sum())
        if m < LEAST_INSTANTS:
            return None
        sizes, ends, places, here, noise = others.without(sensor), [], [], [], []
        for joint, fit in zip(joints, fits):
            expected, use = sizes.expected(fit.couple.parts), pairs.use(*joint)
            sums = _weighted_sums(fit, use, expected)
            sides = np.array([s.sum(axis=0) for s in (sums[:k], sums[k + 1 :])])
            steps, covariances = _side_steps(sides)
            left = np.einsum("si,sij,sj->", steps, sides, steps) / fit.couple.count
            here.append(float(expected[k]))
            noise.append(here[-1] * max(1.0, left / max(1, use.sum() - 1)))
            own = 3 * joint.index(sensor) + np.arange(3)
            unknowns = fit.unknowns + steps.mean(axis=0)[:-1]
            at = (fit.unknowns + steps[:, :-1])[:, own]
            spread = covariances[:, own[:, None], own] + SKIN_SHIFT**2 * np.eye(3)
            unknowns[own] = at[0]
            ends.append(_End.of(pairs, joint, unknowns, sensor, k, there))
            places.append((_Place(at[0], spread[0]), _Place(at[1], spread[1])))
        usual = float(np.mean(noise))
        neighbours = [j[1 - j.index(sensor)] for j in joints]
        between = _between_samples(pairs, neighbours, k)[there]
        expects = float(np.mean(here))
        return cls(ends, places, there, expects, usual, usual / (usual + between))

    def evidence(self, turn: Array, course: "_Course") -> float:
        """Log likelihood ratio of a turn (3,) rad that goes on so against none, wherever the joints lie and however large noise is in this window."""
        still, mismatch = self._misfit(np.zeros(3), course)
        turned, then = self._misfit(turn, course)
        return self.log_ratio(still, turned) + 0.5 * (mismatch - then)

    def explains(self, turn: Array, course: "_Course") -> bool:
        """Whether a turn leaves no more than the recording's other joints let expect, about, or hardly anything of what is left without it."""
        still, turned = (
            self.noise * float((self.weight * self._misfit(t, course)[0]).mean())
            for t in (np.zeros(3), turn)
        )
        return turned < max(UNEXPLAINED * self.expected, HARDLY * still)

    def most_evidence(self) -> float:
        """Of any turn: one that leaves what is expected, and brings all places together."""
        still, mismatch = self._misfit(np.zeros(3), _Course.of(self.there, np.zeros(1), np.ones(1)))
        return self.log_ratio(still, np.ones(len(still))) + 0.5 * mismatch

    def log_ratio(self, still: Array, turned: Array) -> float:
        """Of likelihoods, by mean squares (m,) that are left with a turn and without one in units of what is usual; the window's own noise is as probable to be any multiple of that as half of them tell it."""
        kept = np.arange(len(still)) != np.argmax(still)  # a knock leaves much at one instant
        count = 3 * len(self.ends) * (len(still) - 1) / DEPENDENT
        ratio = [1 + float((self.weight * left)[kept].mean()) for left in (still, turned)]
        return count * float(np.log(ratio[0] / ratio[1]))

    def _misfit(self, turn: Array, course: "_Course") -> tuple[Array, float]:
        """Mean squares (m,) that a turn leaves in units of what is usual, and how far places lie from each other and from where the window has them, normalised and squared."""
        R, squares, far = quat.matrix(quat.exp(turn)), np.zeros(len(self.weight)), 0.0
        for end, (before, after) in zip(self.ends, self.places):
            place, mismatch = before.combined(after.rotated(R))
            left, off = end.fitted(turn, course, place, self.noise)
            squares += (left**2).mean(axis=1) / self.noise / len(self.ends)
            far += mismatch + off
        return squares, far


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


def _side_steps(sums: Array) -> tuple[Array, Array]:
    """From a joint's unknowns to those (2, 13), followed by 1, that fit the sums (2, 13, 13) of windows on either side best, and their covariances (2, 12, 12)."""
    prior = np.diag(1 / FREE[[0, 0, 0, 0, 0, 0, 3, 3, 3, 3, 3, 3]] ** 2)
    covariance = np.linalg.inv(sums[:, :-1, :-1] / DEPENDENT + prior)
    step = -covariance @ sums[:, :-1, -1:] / DEPENDENT
    return np.append(step[..., 0], np.ones((2, 1)), axis=1), np.asarray(covariance)


def _turning(asked: _Asked, others: Others) -> Slip | None:
    """The sensor's turn in a window that explains best what its joints leave; None where that is not convincing, or its rates do not show it."""
    window = _Window.of(asked.pairs, others, asked.sensor, asked.window)
    if window is None or window.most_evidence() < PROMISING:
        return None  # whatever the turn
    fits = (False, True) if asked.seen is not None else (False,)
    found = [_slip(asked, window, is_free) for is_free in fits]
    return min((s for s in found if s is not None), key=lambda s: s.p_value, default=None)


def _slip(asked: _Asked, window: "_Window", is_free: bool) -> Slip | None:
    """The same with joints where the windows before tell them, or free to lie nearby."""
    pairs, sensor, k, turn = asked.pairs, asked.sensor, asked.window, np.zeros(3)
    begins = np.arange(-INSTANT, joint_windows.LENGTH, INSTANT)
    begin, length = (v.ravel() for v in np.meshgrid(begins, LENGTHS))
    whole = begin + length <= joint_windows.LENGTH
    if asked.seen is not None:
        whole &= np.abs(begin + 0.5 * length - asked.seen.middle) < AROUND
        flexion = np.array([0.0, 0.0, asked.seen.angle])
        turn = quat.rotate(quat.conjugate(pairs.q_BS[sensor]), flexion)
    turn = np.tile(turn, (int(whole.sum()), 1))
    best = _fitted(window, turn, begin[whole], length[whole], is_free)
    for _ in range(REFINED):
        shift, factor = (v.ravel() for v in np.meshgrid(SHIFTS, FINER))
        turn = np.tile(best.turn, (len(shift), 1))
        best = _fitted(window, turn, best.begin + shift, best.length * factor, is_free)
    course = _Course.of(window.there, np.array([best.begin]), np.array([best.length]))
    evidence = window.evidence(best.turn, course)
    if evidence < CONVINCING or not window.explains(best.turn, course):
        return None
    seen, sd = isolated_turns.share_seen(pairs, sensor, k, best.turn, best.begin, best.length)
    start = float(pairs.windows(sensor).t[k] + best.begin)
    found = Slip(sensor, best.turn, start, COINCIDENT * float(np.exp(-evidence)), True)
    return found if abs(seen - 1.0) < OFF + 2 * sd else None


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

    def left(self, turn: Array, course: _Course, off: Array) -> Array:
        """What is left (C, m, 3) m/s^2 of the joint's acceleration if the sensor turned so (C, 3) on its segment and the joint lies `off` (C, 3) m from where it is known to, the rotation between the sensors being free."""
        by = turn[:, None]
        so_far, place = course.share[..., None] * by, (self.place + off)[:, None]
        place = place - quat.cross(so_far, place - 0.5 * quat.cross(so_far, place))
        own = course.rate[..., None] * by  # rad/s, of the sensor against its segment
        change = course.change[..., None] * by + quat.cross(self.rate, own)
        of_segment = quat.cross(own, quat.cross(own - self.rate, place))
        too_much = (
            quat.cross(change, place) + quat.cross(self.rate, quat.cross(own, place)) - of_segment
        )
        seen = self.force + np.einsum("mij,cmj->cmi", self.arm, place)
        seen = seen - np.einsum("mij,cmj->cmi", self.turned, too_much)
        R = common_joint.aligned(self.by_neighbour.T @ seen)
        return np.asarray(self.by_neighbour - seen @ np.swapaxes(R, 1, 2))

    def fitted(
        self, turn: Array, course: _Course, place: _Place, noise: float
    ) -> tuple[Array, float]:
        """What is left (m, 3) m/s^2 of a turn (3,) at the place that explains the window best, near one that is known; how far it lies from that, normalised and squared."""
        information, off = np.linalg.inv(place.covariance), place.mean - self.place
        for _ in range(STEPS - 1):
            near = off + MOVED * np.eye(4, 3, -1)
            left = self.left(np.tile(turn, (4, 1)), course, near).reshape(4, -1)
            by = (left[1:] - left[0]) / MOVED
            normal = by @ by.T / (DEPENDENT * noise) + information
            right = by @ left[0] / (DEPENDENT * noise)
            right += information @ (self.place + off - place.mean)
            off = off - np.linalg.solve(normal, right)
        away = self.place + off - place.mean
        return self.left(turn[None], course, off[None])[0], float(away @ information @ away)


@dataclass(frozen=True)
class _Fit:
    """A turn and what it leaves."""

    turn: Array  # (3,) rad
    begin: float  # s, in the window
    length: float  # s


def _fitted(window: _Window, turn: Array, begin: Array, length: Array, is_free: bool) -> _Fit:
    """Of turns near some (C, 3) that go on so the one that explains most, the joints where the windows before tell them or free to lie nearby; small turns are as probable as TURN_SD says."""
    course, C, E = _Course.of(window.there, begin, length), len(turn), len(window.ends)
    free = 3 * E if is_free else 0
    prior = np.zeros((3 + free, 3 + free))
    prior[:3, :3] = np.eye(3) / TURN_SD**2
    for k, (before, _) in enumerate(window.places if is_free else ()):
        part = slice(3 + 3 * k, 6 + 3 * k)
        prior[part, part] = DEPENDENT * np.linalg.inv(before.covariance)
    prior *= window.noise

    def left(x: Array) -> Array:
        off = np.split(x[:, 3:], E, axis=1) if is_free else [np.zeros((C, 3))] * E
        every = [e.left(x[:, :3], course, o) for e, o in zip(window.ends, off)]
        return np.stack(every, axis=1).reshape(C, -1)

    def derivatives(x: Array, e: Array) -> Array:
        by = np.zeros((*e.shape, x.shape[1]))
        for k, step in enumerate(DIFFERENCE * np.eye(3, x.shape[1])):
            by[..., k] = (left(x + step) - e) / DIFFERENCE
        each, per = e.reshape(C, E, -1), by.reshape(C, E, -1, x.shape[1])
        for k, end in enumerate(window.ends if is_free else ()):
            for axis, step in enumerate(MOVED * np.eye(3)):
                c = 3 + 3 * k + axis
                moved = end.left(x[:, :3], course, x[:, 3 + 3 * k : 6 + 3 * k] + step)
                per[:, k, :, c] = (moved.reshape(C, -1) - each[:, k]) / MOVED
        return by

    def cost(x: Array, e: Array) -> Array:
        return np.asarray((e**2).sum(axis=1) + ((x @ prior) * x).sum(axis=1))

    x = np.concatenate([turn, np.zeros((C, free))], axis=1)
    e = left(x)
    for _ in range(STEPS):
        by = derivatives(x, e)
        normal = np.swapaxes(by, 1, 2) @ by + prior
        right = (e[:, None] @ by)[:, 0] + x @ prior
        tried = x - np.linalg.solve(normal, right[..., None])[..., 0]
        then = left(tried)
        less = (cost(tried, then) < cost(x, e))[:, None]
        x, e = np.where(less, tried, x), np.where(less, then, e)
    best = int(np.argmin(cost(x, e)))
    return _Fit(x[best, :3], float(begin[best]), float(length[best]))


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
