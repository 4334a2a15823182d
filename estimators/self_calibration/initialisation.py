"""Initial values from the readings alone: fusion of each sensor, then by joint the heading and the arms that make both accelerations of its centre agree.

In      even readings of a chain's sensors; nominal flexion axes in the sensors' frames
Out     the solver's initial unknowns
Source  orientations: VQF, offline variant, Laidig & Seel 2023; arms: linear least squares as Seel et al. 2012, IEEE MSC, 45, for each of many headings;
        axes of hinges: the pair of directions that stays together best, by SVD
Limits  beside a sensor that does not turn the heading is unobservable: it is the nominal mounting's there
"""

from collections.abc import Sequence

import numpy as np
from vqf import offlineVQF

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.problem import Chain, Noise, Readings, Unknowns
from handscope.estimators.self_calibration.residuals import NUMEROV, SECOND_DIFFERENCE

HEADINGS = 72
PART = 15.0  # s in which what fusion leaves of biases, up to 0.6 deg/s, turns a heading by little
ROUNDS = 4  # of headings for the same arms, and arms for the same headings
# of the horizontal and the vertical by a heading: what stays, goes with its cosine, with its sine
TURNS = np.array(
    [
        [[0.0, 0, 0], [0, 0, 0], [0, 0, 1]],
        [[1, 0, 0], [0, 1, 0], [0, 0, 0]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 0]],
    ]
)
EXPECTED = 0.05  # m, how far a joint usually is from a sensor
MOUNTED = 0.05  # share of the residual by which a heading square to the nominal one must be better; an observable one is better by far


def initial_unknowns(chain: Chain, noise: Noise, readings: Readings, flexing: Array) -> Unknowns:
    """Initial unknowns; `flexing` (S, 3) are the nominal flexion axes in the sensors' frames."""
    q_GS = fuse_sensors(readings)
    far, near = np.zeros((len(chain.joints), 3)), np.zeros((len(chain.joints), 3))
    for k, (i, j) in enumerate(zip(chain.parents, chain.children)):
        _, heading, far[k], near[k] = fit_joint(noise, readings, q_GS, int(i), int(j), flexing)
        q_GS[:, j] = quat.turn_heading(q_GS[:, j], heading)
    turned = quat.log(quat.relative(q_GS[:-1], q_GS[1:])) / readings.dt
    bias = (0.5 * (readings.gyr[1:] + readings.gyr[:-1]) - turned).mean(axis=0)
    pairs = [
        common_axis(q_GS[:, chain.parents[k]], q_GS[:, chain.children[k]]) for k in chain.hinges
    ]
    axes = np.array(pairs).reshape(-1, 2, 3)
    none, whole = np.zeros((len(far), 3)), np.zeros((len(bias), 3, 3))
    return Unknowns(
        q_GS,
        far,
        near,
        bias,
        np.zeros_like(bias),
        whole,
        whole,
        axes[:, 0],
        axes[:, 1],
        none,
        none,
        np.zeros(1),
        np.zeros((len(far), 2)),
        np.zeros(len(far)),
    )


def fuse_sensors(readings: Readings) -> Array:
    """Orientations (n, S, 4), each with a heading of its own."""
    q_GS = np.empty((*readings.gyr.shape[:2], 4))
    for s in range(readings.gyr.shape[1]):
        out = offlineVQF(
            np.ascontiguousarray(readings.gyr[:, s]),
            np.ascontiguousarray(readings.acc[:, s]),
            None,
            readings.dt,
        )
        q_GS[:, s] = out["quat6D"]
    return q_GS


def fit_joint(
    noise: Noise, readings: Readings, q_GS: Array, i: int, j: int, flexing: Array
) -> tuple[float, Array, Array, Array]:
    """Residual (sum of squares), the turn (n,) of j about the vertical, and the arms in the frames of i and j for which the accelerations of their joint agree.

    The turn is one of HEADINGS in each part of the recording, which bring about equal turning, and changes evenly from one to the next: what fusion leaves of biases turns it.
    """
    where, knots = _parts_of_equal_turning(readings, i, j)
    wholes, off = _squares(readings, q_GS, i, j, flexing, where)
    ridge = (noise.acc / EXPECTED) ** 2
    least = [_arms(whole, ridge) for whole in wholes]  # of every heading
    alone = [int(np.argmin(size * (1 + MOUNTED * o))) for (size, _), o in zip(least, off)]
    each, places = np.arange(len(wholes)), [arms[k] for (_, arms), k in zip(least, alone)]
    best = (np.inf, np.array(alone), places[0])
    for arms in places:
        for _ in range(ROUNDS):
            size = np.einsum("a,wkab,b->wk", arms, wholes, arms)
            chosen = np.argmin(size * (1 + MOUNTED * off), axis=1)
            residual, arms = (v[0] for v in _arms(wholes[each, chosen].sum(axis=0)[None], ridge))
            shared = float(residual * (1 + MOUNTED * off[each, chosen].mean()))
            if shared < best[0]:
                best = (shared, chosen, arms)
    residual, chosen, arms = best
    turns = np.unwrap(chosen * 2 * np.pi / HEADINGS)
    return residual, np.interp(np.arange(len(readings)), knots, turns), arms[:3], arms[4:7]


def _parts_of_equal_turning(readings: Readings, i: int, j: int) -> tuple[list[slice], Array]:
    """Parts of a recording of about PART s, shorter where its two sensors turn more; the middle of each, counted by their turning."""
    turning = (readings.gyr[1:-1, [i, j]] ** 2).sum(axis=(1, 2)) + 1e-12
    count = max(1, round(len(readings) * readings.dt / PART))
    share = np.cumsum(turning) / turning.sum()
    edges = np.unique([0, *share.searchsorted(np.arange(1, count) / count), len(turning)])
    middles = 0.5 * (share[edges[:-1]] + share[edges[1:] - 1])
    parts = [slice(a, b) for a, b in zip(edges, edges[1:])]
    return parts, np.asarray(share.searchsorted(middles) + 1, float)


def _squares(
    readings: Readings, q_GS: Array, i: int, j: int, flexing: Array, where: Sequence[slice]
) -> tuple[Array, Array]:
    """Of each part and heading the matrix (parts, HEADINGS, 8, 8) by which both arms, each followed by 1, make the residual; how far the nominal axes are apart (parts, HEADINGS)."""
    (A_i, f_i), (A_j, f_j) = (_acceleration_by_arm(readings, q_GS[:, s], s) for s in (i, j))
    # (n-2, 3, 4): by the arm, and without it
    M_i, M_j = (np.concatenate([A, f[..., None]], axis=2) for A, f in ((A_i, f_i), (A_j, f_j)))
    z_i, z_j = (quat.rotate(q_GS[1:-1, s], flexing[s]) for s in (i, j))
    heading = np.arange(HEADINGS) * 2 * np.pi / HEADINGS
    by_heading = np.stack([np.ones(HEADINGS), np.cos(heading), np.sin(heading)], axis=1)
    turned = np.einsum("hk,kij->hij", by_heading, TURNS)
    wholes, off = np.empty((len(where), HEADINGS, 8, 8)), np.empty((len(where), HEADINGS))
    for whole, o, part in zip(wholes, off, where):
        sums = np.einsum("tia,tjb->ijab", M_i[part], M_j[part])
        whole[:, :4, :4], whole[:, 4:, 4:] = (
            np.einsum("tia,tib->ab", M[part], M[part]) for M in (M_i, M_j)
        )
        whole[:, :4, 4:] = -np.einsum("hij,ijab->hab", turned, sums)
        whole[:, 4:, :4] = whole[:, :4, 4:].transpose(0, 2, 1)
        agree = np.einsum("ta,tb->ab", z_i[part], z_j[part]) / max(1, part.stop - part.start)
        o[:] = 1 - np.einsum("hij,ij->h", turned, agree)
    return wholes, off


def _arms(wholes: Array, ridge: float) -> tuple[Array, Array]:
    """Least residuals (m,) of matrices (m, 8, 8) of `_squares`, and the arms (m, 8) with a 1 behind each."""
    arms, rest = [0, 1, 2, 4, 5, 6], [3, 7]
    right = wholes[:, arms][:, :, rest].sum(axis=2)
    found = np.ones((len(wholes), 8))
    damped = wholes[:, arms][:, :, arms] + ridge * np.eye(6)
    found[:, arms] = -np.linalg.solve(damped, right[..., None])[..., 0]
    without = wholes[:, rest][:, :, rest].sum(axis=(1, 2))
    return without + np.einsum("ma,ma->m", right, found[:, arms]), found


def common_axis(q_Gi: Array, q_Gj: Array) -> tuple[Array, Array]:
    """The direction in the frame of i and the one in that of j that stay together best over all samples."""
    U, _, Vt = np.linalg.svd(quat.matrix(quat.relative(q_Gi, q_Gj)).mean(axis=0))
    return U[:, 0], Vt[0]


def _acceleration_by_arm(readings: Readings, q: Array, s: int) -> tuple[Array, Array]:
    """A joint's acceleration: its derivative by the arm (n-2, 3, 3), and the part without the arm (n-2, 3)."""
    R = quat.matrix(q)
    f = np.einsum("tij,tj->ti", R, readings.acc[:, s])
    mean = NUMEROV[0] * f[:-2] + NUMEROV[1] * f[1:-1] + NUMEROV[2] * f[2:]
    return (
        SECOND_DIFFERENCE[0] * R[:-2]
        + SECOND_DIFFERENCE[1] * R[1:-1]
        + SECOND_DIFFERENCE[2] * R[2:]
    ) / readings.dt**2, mean
