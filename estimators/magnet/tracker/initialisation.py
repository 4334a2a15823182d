"""Initial state and covariance: at rest at the first complete sample, with the magnet where one
reading shows it.

In      Setup: magnetometers and magnet, the earth's field; one sample of trunk and hand, one
        reading of the magnetometers
Out     state x and covariance P (state.py); declared values with their standard deviations
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.magnet.array.localisation import Localisation, locate
from handscope.estimators.magnet.model import dipole
from handscope.estimators.magnet.model.setup import Constellation, Magnet
from handscope.estimators.magnet.tracker.options import (
    CALIBRATED_VARIANCE,
    DEG,
    GRADIENT_VARIANCE,
    MagnetParams,
    noise_model,
)
from handscope.estimators.magnet.tracker.state import ERROR, OWN, STATE, rows
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.fusion import make_upright

ROOM_VARIATION = 1e-6  # T by which the field of a room differs from the earth's
MIN_LEVEL_SHARE = 0.5  # horizontal share of the moment that observes heading
PINNED_SD = 1e-9  # T, field across itself: zero by the choice of g; if free, heading drifts


@dataclass(frozen=True)
class Setup:
    """What is known before the first sample."""

    array: Constellation
    magnet: Magnet
    earth: float  # T, strength of the field in which the magnetometers were calibrated
    dip: float | None = None  # rad below the horizon, if it is known
    # (3,) m, middle of the workspace, base frame; None: the array's middle
    centre: Array | None = None
    q_bt: Array | None = None  # (4,) orientation of the hand at the start, if it is known


def initial_state(
    params: MagnetParams,
    setup: Setup,
    sample: Array,
    mag: Array,
    mag_b: Array,
    near: tuple[Array, Array, Array] | None = None,
) -> tuple[Array, Array]:
    """State and covariance at the first complete sample: at rest, inclinations from gravity,
    headings from the field and, if it is near, from the magnet."""
    near = _locate_magnet(params, setup, mag) if near is None else near
    B_b = mag_b.mean(axis=0) if near is None else near[2]
    q_gb = make_upright(quat.IDENTITY, sample[3:6])
    B_g = quat.rotate(q_gb, B_b)
    north = np.arctan2(B_g[0], B_g[1])
    q_gb = quat.turn_heading(q_gb, north)
    level = np.array([0.0, np.hypot(B_g[0], B_g[1]), B_g[2]])
    if setup.dip is not None:
        level = setup.earth * np.array([0.0, np.cos(setup.dip), -np.sin(setup.dip)])
    q_gt = make_upright(
        quat.IDENTITY if setup.q_bt is None else quat.multiply(q_gb, setup.q_bt), sample[9:12]
    )
    turn, lost = _hand_heading(setup, q_gb, q_gt, near)
    q_bt = quat.multiply(quat.conjugate(q_gb), quat.turn_heading(q_gt, turn))
    p = workspace_centre(setup) if near is None else near[0] - quat.rotate(q_bt, setup.magnet.place)
    x = np.concatenate(
        [p, np.zeros(3), q_bt, level, np.zeros(6), q_gb, np.zeros(9), declared_values(setup)]
    )
    return x, initial_covariance(params, setup, sample, near is None, lost)


def _hand_heading(
    setup: Setup, q_gb: Array, q_gt: Array, near: tuple[Array, Array, Array] | None
) -> tuple[float, bool]:
    """By how much the hand's heading must be turned, rad, and whether it is unobservable."""
    if setup.q_bt is not None or near is None:
        return 0.0, setup.q_bt is None
    m_g, seen = quat.rotate(q_gt, setup.magnet.moment), quat.rotate(q_gb, near[1])
    if min(np.hypot(*m_g[:2]), np.hypot(*seen[:2])) < MIN_LEVEL_SHARE * setup.magnet.size:
        return 0.0, True  # a vertical moment has no heading
    return float(np.arctan2(seen[1], seen[0]) - np.arctan2(m_g[1], m_g[0])), False


def initial_covariance(
    params: MagnetParams, setup: Setup, sample: Array, far: bool, lost: bool
) -> Array:
    """At the first sample; `far`: the magnet's position is unknown, `lost`: the hand's heading."""
    incl, head = params.inclination_sd * DEG, params.heading_sd * DEG
    up_b, up_t = (v / np.linalg.norm(v) for v in (sample[3:6], sample[9:12]))
    P = np.diag(np.concatenate([np.zeros(OWN), declared_sds(params, setup) ** 2]))
    p, th, thg = rows(ERROR.p_bt), rows(ERROR.th_bt), rows(ERROR.th_gb)
    P[p, p] = np.eye(3) * (params.reach**2 / 3 if far else 0.05**2)
    for v in (rows(ERROR.v_bt), rows(ERROR.v_b)):
        P[v, v] = np.eye(3) * 0.1**2
    P[th, th] = np.eye(3) * incl**2 + np.outer(up_t, up_t) * (2 * head if lost else head) ** 2
    P[thg, thg] = np.eye(3) * incl**2 + np.outer(up_b, up_b) * (2 * head if far else head) ** 2
    room_sd = 0.1 * setup.earth if setup.dip is None else ROOM_VARIATION
    B = rows(ERROR.B_g)
    P[B, B] = np.diag(np.array([PINNED_SD, room_sd, room_sd]) ** 2)
    biases = np.diag(np.repeat([params.gyr_bias_sd * DEG, params.acc_bias_sd], 3) ** 2)
    for first in (ERROR.gyr_bias_t, ERROR.gyr_bias_b):  # the accelerometer's follow
        P[rows(first, 6), rows(first, 6)] = biases
    return P


def declared_values(setup: Setup) -> Array:
    """The state's rows from STATE.moment on before the first reading: moment, its position, gradients,
    calibration residuals, positions of the magnetometers, latency."""
    return np.concatenate(
        [
            setup.magnet.moment,
            setup.magnet.place,
            np.zeros(6 + setup.array.places.size),
            setup.array.places.ravel(),
            [0.0],
        ]
    )


def declared_sds(params: MagnetParams, setup: Setup) -> Array:
    """Their standard deviations."""
    many = setup.array.places.size
    return np.repeat(
        [
            params.magnet_error * setup.magnet.size,
            params.lever_error,
            1e-6 * params.field_gradient * np.sqrt(GRADIENT_VARIANCE),
            1e-6 * params.field_gradient * np.sqrt(CALIBRATED_VARIANCE),
            1e-6 * params.mag_error,
            params.place_error,
            params.latency_sd,
        ],
        [3, 3, 5, 1, many, many, 1],
    )


def array_span(array: Constellation) -> float:
    """RMS distance of the magnetometers from their middle, m."""
    return float(np.sqrt(((array.places - array.places.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _locate_magnet(
    params: MagnetParams, setup: Setup, mag: Array
) -> tuple[Array, Array, Array] | None:
    """Position and moment of the magnet and the field without it, base frame, from one reading;
    None where the array does not see it well."""
    if len(setup.array) < 3:
        return None
    noise = noise_model(params, array_span(setup.array)).single
    localisation = locate(
        mag[None], setup.array, None, setup.magnet.size, noise, params.reach, 0.03
    )
    sure = bool(localisation.is_located[0])
    if not sure and np.isfinite(
        localisation.residual_rms[0]
    ):  # close by, errors of declared positions and moment exceed the noise
        noise = float(np.hypot(noise, _declaration_error(params, setup, localisation)))
        localisation = locate(
            mag[None], setup.array, None, setup.magnet.size, noise, params.reach, 0.03
        )
        # all errors counted: a true position leaves less 98 times of 100
        sure = bool(localisation.is_located[0] and localisation.residual_rms[0] < noise)
    return (localisation.place[0], localisation.moment[0], localisation.field[0]) if sure else None


def _declaration_error(params: MagnetParams, setup: Setup, localisation: Localisation) -> float:
    """RMS error of a reading, T an axis, caused by errors of declared positions and moment."""
    r, size = (
        localisation.place[0] - setup.array.places,
        np.maximum(np.linalg.norm(localisation.moment[0]), setup.magnet.size),
    )
    moment = localisation.moment[0] * setup.magnet.size / size
    by_place, own = (
        dipole.field_gradient(r, moment) * params.place_error,
        dipole.field_by_moment(r) * params.magnet_error * setup.magnet.size,
    )
    return float(np.sqrt(((by_place**2).sum(axis=-1) + (own**2).sum(axis=-1)).mean()))


def workspace_centre(setup: Setup) -> Array:
    """Centre of the workspace (3,) in the base's frame, m."""
    return setup.array.places.mean(axis=0) if setup.centre is None else setup.centre


def magnet_in_base(x: Array) -> tuple[Array, Array, Array]:
    """Position and moment of a state's magnet and the field without it, base frame."""
    q_bt = x[rows(STATE.q_bt, 4)]
    B_b = quat.rotate(quat.conjugate(x[rows(STATE.q_gb, 4)]), x[rows(STATE.B_g)])
    return (
        x[rows(STATE.p_bt)] + quat.rotate(q_bt, x[rows(STATE.lever)]),
        quat.rotate(q_bt, x[rows(STATE.moment)]),
        B_b,
    )
