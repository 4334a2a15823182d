"""Initial values from the readings alone: fusion of each sensor, then by joint the heading and the arms that make both accelerations of its centre agree.

In      even readings of a chain's sensors; nominal flexion axes in the sensors' frames
Out     the solver's initial unknowns
Source  orientations: VQF, offline variant, Laidig & Seel 2023; arms: linear least squares as Seel et al. 2012, IEEE MSC, 45, for each of many headings;
        axes of hinges: the pair of directions that stays together best, by SVD
Limits  beside a sensor that does not turn the heading is unobservable: it is the nominal mounting's there
"""

import numpy as np
from vqf import offlineVQF

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.problem import Chain, Noise, Readings, Unknowns
from handscope.estimators.self_calibration.residuals import NUMEROV, SECOND_DIFFERENCE

HEADINGS = 72
EXPECTED = 0.05  # m, how far a joint usually is from a sensor
MOUNTED = 0.05  # share of the residual by which a heading square to the nominal one must be better; an observable one is better by far


def initial_unknowns(chain: Chain, noise: Noise, readings: Readings, flexing: Array) -> Unknowns:
    """Initial unknowns; `flexing` (S, 3) are the nominal flexion axes in the sensors' frames."""
    q_GS, bias = fuse_sensors(readings)
    far, near = np.zeros((len(chain.joints), 3)), np.zeros((len(chain.joints), 3))
    for k, (i, j) in enumerate(zip(chain.parents, chain.children)):
        _, heading, far[k], near[k] = fit_joint(noise, readings, q_GS, int(i), int(j), flexing)
        q_GS[:, j] = quat.turn_heading(q_GS[:, j], heading)
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


def fuse_sensors(readings: Readings) -> tuple[Array, Array]:
    """Orientations (n, S, 4), each with a heading of its own, and biases (S, 3) as they are on average."""
    q_GS, bias = np.empty((*readings.gyr.shape[:2], 4)), np.empty((readings.gyr.shape[1], 3))
    for s in range(readings.gyr.shape[1]):
        out = offlineVQF(
            np.ascontiguousarray(readings.gyr[:, s]),
            np.ascontiguousarray(readings.acc[:, s]),
            None,
            readings.dt,
        )
        q_GS[:, s], bias[s] = out["quat6D"], out["bias"].mean(axis=0)
    return q_GS, bias


def fit_joint(
    noise: Noise, readings: Readings, q_GS: Array, i: int, j: int, flexing: Array
) -> tuple[float, float, Array, Array]:
    """Residual (sum of squares), the turn of j about the vertical, and the arms in the frames of i and j for which the accelerations of their joint agree."""
    (A_i, f_i), (A_j, f_j) = (_acceleration_by_arm(readings, q_GS[:, s], s) for s in (i, j))
    # (n-2, 3, 4): by the arm, and without it
    M_i, M_j = (np.concatenate([A, f[..., None]], axis=2) for A, f in ((A_i, f_i), (A_j, f_j)))
    own = [np.einsum("tia,tib->ab", M, M) for M in (M_i, M_j)]
    turns = (
        np.diag([0.0, 0, 1]),
        np.diag([1.0, 1, 0]),
        np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]]),
    )
    upright, level, across = (np.einsum("tia,ij,tjb->ab", M_i, turn, M_j) for turn in turns)
    z_i, z_j = (quat.rotate(q_GS[:, s], flexing[s]) for s in (i, j))
    axis_agreement = [float(np.einsum("ta,ab,tb->t", z_i, turn, z_j).mean()) for turn in turns]
    best = (np.inf, 0.0, np.zeros(6))
    ridge = (noise.acc / EXPECTED) ** 2 * np.eye(6)
    for heading in np.arange(HEADINGS) * 2 * np.pi / HEADINGS:
        cross = upright + np.cos(heading) * level + np.sin(heading) * across
        whole = np.block([[own[0], -cross], [-cross.T, own[1]]])
        arms, rest = [0, 1, 2, 4, 5, 6], [3, 7]
        right = whole[np.ix_(arms, rest)].sum(axis=1)
        arms_6 = -np.linalg.solve(whole[np.ix_(arms, arms)] + ridge, right)
        off = 1 - (
            axis_agreement[0]
            + np.cos(heading) * axis_agreement[1]
            + np.sin(heading) * axis_agreement[2]
        )
        residual = float(whole[np.ix_(rest, rest)].sum() + right @ arms_6) * (1 + MOUNTED * off)
        best = min(best, (residual, float(heading), arms_6), key=lambda b: b[0])
    return best[0], best[1], best[2][:3], best[2][3:]


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
