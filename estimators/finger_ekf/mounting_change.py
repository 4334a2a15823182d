"""A sensor that has turned on its segment: a step in the innovations of the angles that its joints cannot have.

In      innovations of forbidden angles with their Jacobians, summed second by second; which sensor is where in the chains
Out     which sensor has turned, since when, by how much; the covariance of its mounting, widened
Source  generalised likelihood ratio of a step in the mounting against none: Willsky & Jones 1976, IEEE Trans Autom Control 21:108; without their feedback, as
        the filter hardly follows innovations that it takes for unlikely. Ours: what the seconds before show is common to both hypotheses, so that what joints
        and skin do all the time is no step
        What bridging gaps has missed stays in the joints until something corrects it, and looks like a turn: an offset of that variance is common to both, too
Limits  a turn about a freedom of the joint is not seen: of a finger's sensors that about the axis of flexion
"""

from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.mounting_change import MountingChange
from handscope.estimators.finger_ekf.joint_compliance import ASSUMED
from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS
from handscope.estimators.hand.forward_kinematics import CHAIN_SEGMENTS
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.tail_probabilities import chi2_sf
from handscope.estimators.numerics.typing import Array, Indices

_WRIST = [SEGMENT[s] for s in ("forearm", "hand", "hand", "hand")]
# (6, 4) segments of each chain's sensors
SENSORS: Indices = np.vstack(
    [np.column_stack([np.full(5, SEGMENT["hand"]), CHAIN_SEGMENTS]), _WRIST]
)
# (segments, 24) 1 where the sensor of a chain is the segment's
_IS_OF = (SENSORS.ravel() == np.arange(len(SEGMENTS))[:, None]).astype(float)
_NEAR: Array = np.zeros((len(SEGMENTS), len(SEGMENTS)))
_NEAR[SENSORS[:, 1:], SENSORS[:, :-1]] = _NEAR[SENSORS[:, :-1], SENSORS[:, 1:]] = 1.0
np.fill_diagonal(_NEAR, 0.0)  # the wrist's chain has the hand several times
_NEAR /= _NEAR.sum(axis=1, keepdims=True)  # (segments, segments) mean over a segment's neighbours
BLOCK = 1.0  # s over which innovations are summed
AFTER, BEFORE = 8, 20  # blocks since a step, and before it, that are compared
LOOKED_AT = np.array([1, 2, 4, 8])  # of those since a step, in which one is looked for
LEAST_BEFORE = 3  # blocks
LASTING = 2  # blocks that what a gap hid lasts in the joints, at least
STEP_SD = np.radians(10.0)  # of a step, each axis
COMMON_SD = np.radians(5.0)  # of what is there before a step, too
TESTS = 3600.0 / BLOCK * AFTER * len(SEGMENTS)  # an hour
FALSE_ALARMS = (
    0.1  # an hour, of sensors that stay, if innovations are white and as large as believed
)
UNDECIDED = 2 * np.log(
    100.0
)  # likelihood ratios nearer than 100 to the best do not tell two sensors apart


@dataclass(frozen=True)
class History:
    """What the newest blocks tell of steps, the oldest first."""

    end: float  # s, of the newest block
    score: Array  # (n, segments, 3) rad^-1
    information: Array  # (n, segments, 3, 3) rad^-2
    compliance_stats: Array  # (n, chains, 3, 2) at the end of each block
    missed: Array  # (n + 1, segments) rad^2 that gaps may have hidden in each block; last since the newest one


@inlined
def accumulate_row(
    p: KernelParams, own_variance: Array, reference_compliance: Array, free: Array, span: float,
    innovation: Array, H: Array, score: Array, information: Array,
) -> None:  # fmt: skip
    """Add rows 9..17, whose variances `own_variance` (9,) the filter's errors make, to the score (4, 3) and the information (4, 3, 3) of a step in each sensor's mounting."""
    lasts, usual = max(1.0, p.correlation / span), p.dimension_noise**2
    for j in range(3):
        give = max(
            (ASSUMED * usual + reference_compliance[j, 0]) / (ASSUMED + reference_compliance[j, 1]),
            usual,
        )
        for a in range(3):
            row = 9 + 3 * j + a
            if own_variance[row - 9] > 0 and free[j, a] == 0:
                weight = 1.0 / (own_variance[row - 9] + lasts * give)
                for s in range(j, j + 2):
                    h = H[row, ERROR.q_SB + 3 * s : ERROR.q_SB + 3 * s + 3]
                    for b in range(3):
                        score[s, b] += weight * h[b] * innovation[row]
                        for c in range(3):
                            information[s, b, c] += weight * h[b] * h[c]


def begin(t: float) -> History:
    """Without any block."""
    n, F = len(SEGMENTS), len(SENSORS)
    nothing = np.zeros((0, n, 3)), np.zeros((0, n, 3, 3)), np.zeros((0, F, 3, 2))
    return History(t, *nothing, np.zeros((1, n)))


def count_missed(history: History, variance: Array) -> History:
    """With the variances (F, 4) rad^2 of the chains' sensors from gaps since the update before."""
    missed = history.missed.copy()
    by_chain = np.zeros((len(SEGMENTS), SENSORS.size))
    by_chain[SENSORS.ravel(), np.arange(SENSORS.size)] = variance.ravel()
    missed[-1] += by_chain.max(axis=1)
    return replace(history, missed=missed)


def extend(
    history: History, t: float, score: Array, information: Array, compliance_stats: Array
) -> History:
    """With the block that ends at t, of the chains' scores (F, 4, 3) and information (F, 4, 3, 3)."""
    n = len(SEGMENTS)
    scores, known, stats = (
        np.concatenate([before[-(AFTER + BEFORE - 1) :], now[None]])
        for before, now in (
            (history.score, (_IS_OF @ score.reshape(-1, 3)).reshape(n, 3)),
            (history.information, (_IS_OF @ information.reshape(-1, 9)).reshape(n, 3, 3)),
            (history.compliance_stats, compliance_stats),
        )
    )
    missed = np.concatenate([history.missed[-(AFTER + BEFORE) :], np.zeros((1, n))])
    return History(t, scores, known, stats, missed)


def compliance_before(history: History) -> Array:
    """Compliance statistics (F, 3, 2) from before any step that is looked for; none if there are not as many blocks."""
    stats = history.compliance_stats
    return stats[-AFTER - 1] if len(stats) > AFTER else np.zeros(stats.shape[1:])


def find(history: History) -> MountingChange | None:
    """The likeliest step, if so likely a one is rare where no sensor has turned."""
    most = len(history.score) - LEAST_BEFORE  # blocks since a step
    lengths = LOOKED_AT[most >= LOOKED_AT]
    if not len(lengths) or _expected(_likelihood_ratios(history, lengths)[0].max()) > FALSE_ALARMS:
        return None
    lengths = np.arange(1, min(AFTER, most) + 1)
    ratio, turn = _likelihood_ratios(history, lengths)
    k, best = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    of_each = ratio.max(axis=0)
    likeliest = np.argsort(-of_each, kind="stable")
    undecided = likeliest[of_each[likeliest] > ratio[k, best] - UNDECIDED]
    return MountingChange(
        tuple(SEGMENTS[s] for s in undecided),
        history.end - float(lengths[k]) * BLOCK,
        history.end,
        float(np.linalg.norm(turn[k, best])),
        _expected(ratio[k, best]),
    )


def widen(change: MountingChange, P: Array) -> Array:
    """Covariances (F, 43, 43) in which the sensors' mounting may have turned about any axis, as far as steps do or, where it is more, as this one has."""
    P = P.copy()
    added = max(change.turn**2 / 2, STEP_SD**2)  # rad^2, each axis: the joints show two of three
    turned = {SEGMENT[s] for s in change.segments}
    for chain, sensor in np.ndindex(SENSORS.shape):
        if int(SENSORS[chain, sensor]) in turned:
            rows = ERROR.q_SB + 3 * sensor + np.arange(3)
            P[chain, rows, rows] += added
    return P


def _expected(ratio: float) -> float:
    """Number of ratios as large in an hour, if no sensor turns."""
    return TESTS * float(chi2_sf(ratio, 3))


def _likelihood_ratios(history: History, lengths: Indices) -> tuple[Array, Array]:
    """Twice the logarithms (n, segments) of the ratios for steps as many blocks ago, and the turns (n, segments, 3), rad."""
    score, information = (
        np.cumsum(x[::-1], axis=0) for x in (history.score, history.information)
    )  # since so many blocks
    after, before = lengths - 1, np.minimum(lengths + BEFORE, len(score)) - 1
    known, eye = information[after], np.eye(3)
    share = known @ np.linalg.inv(information[before] + eye / COMMON_SD**2)
    own, known = score[after] - (share @ score[before][..., None])[..., 0], known - share @ known
    missed = np.cumsum(history.missed[::-1], axis=0)[np.minimum(lengths + LASTING, len(score))]
    missed = (missed + missed @ _NEAR.T) / 3  # each axis: gaps tell the mean square of all
    known, own = (
        np.linalg.solve(eye + known * missed[..., None, None], each)
        for each in (known, own[..., None])
    )
    turn = np.linalg.solve(known + eye / STEP_SD**2, own)[..., 0]
    return (own[..., 0] * turn).sum(axis=-1), turn
