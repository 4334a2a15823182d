"""Derivatives of the residuals of every sample, as compiled loops: most of them are blocks of 3 x 3 in a matrix of zeros.

In      rotations, readings, displacements of sensors by skin, sample by sample; the formulas and their sources stand in residuals.py
Out     arrays of residuals' derivatives, filled
"""

from typing import NamedTuple

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.kernels import right_jacobian_row
from handscope.estimators.numerics.typing import Array, Indices

KNOTS = 3  # samples that a joint's acceleration touches


class Tree(NamedTuple):
    """The tree of joints: sensors on either side of each."""

    parents: Indices  # (J,) rows of sensors
    children: Indices  # (J,)
    before: Indices  # (S,) the joint before each sensor; -1: none


class Motion(NamedTuple):
    """Sensors over T + 2 samples."""

    R: Array  # (T + 2, S, 3, 3)
    read: Array  # (T + 2, S, 3) m/s^2
    force: Array  # (T + 2, S, 3) the same less its errors
    bent: Array  # (T + 2, J) rad, how far skin follows each joint
    by_bending: Array  # (T + 2, J, 3) by the joint's tilt (2) and its law
    back: Array  # (T + 2, S, 3, 3) of `soft_tissue.SensorDisplacement`
    slide: Array  # (T + 2, S, 3)
    turning: Array  # (T + 2, S, 3, 3) right Jacobian of the turn, backwards


class Arms(NamedTuple):
    """Places of a joint from the sensors on either side, and how skin moves the child's sensor."""

    far: Array  # (J, 3) m
    near: Array  # (J, 3)
    skin_turn: Array  # (J, 3) rad/rad
    skin_slide: Array  # (J, 3) m/rad


class Axes(NamedTuple):
    """Of hinges, in the frames of the sensors on either side."""

    joints: Indices  # (H,)
    far: Array  # (H, 3) unit
    near: Array  # (H, 3)
    far_tangents: Array  # (H, 3, 2)
    near_tangents: Array  # (H, 3, 2)


class Turns(NamedTuple):
    """Rotations between samples: of the state, and by the gyroscopes."""

    q_GS: Array  # (T + 1, S, 4)
    read: Array  # (T, S, 3) rad
    corrected: Array  # (T, S, 3) rad, less its errors
    later: Array  # (T, S, 3) rad/s
    sd: Array  # (T, S) rad
    dt: float  # s


@looped
def fill_turns(turns: Turns, r: Array, by_turns: Array, by_parameters: Array) -> None:
    """Residuals (T, S, 3) of gyroscopes and their derivatives (T, S, 3, 2, S, 3), (T, S, 3, 12 S + 1), in standard deviations; elements that are always zero are not written.

    An empty `by_turns` asks for the residuals alone.
    """
    q_ab, q_off, q_turn, v = np.empty(4), np.empty(4), np.empty(4), np.empty(3)
    R, left, right, J = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    S = turns.read.shape[1]
    for t in range(r.shape[0]):
        for s in range(S):
            quat.relative_row(turns.q_GS[t, s], turns.q_GS[t + 1, s], q_ab)
            for i in range(3):
                v[i] = -turns.corrected[t, s, i]
            quat.exp_row(v, v, q_turn)
            quat.multiply_row(q_turn, q_ab, q_off)
            quat.log_row(q_off, v, v)
            sd = turns.sd[t, s]
            for i in range(3):
                r[t, s, i] = v[i] / sd
            if by_turns.shape[0] == 0:
                continue
            _inverse_jacobian(v, 1.0, right)
            _inverse_jacobian(v, -1.0, left)
            quat.matrix_row(q_ab, q_ab, R)
            right_jacobian_row(turns.corrected[t, s], J)
            for i in range(3):
                for j in range(3):
                    by_turns[t, s, i, 1, s, j] = right[i, j] / sd
                    by_turns[t, s, i, 0, s, j] = (
                        -(right[i, 0] * R[j, 0] + right[i, 1] * R[j, 1] + right[i, 2] * R[j, 2])
                        / sd
                    )
                late = 0.0
                for j in range(3):
                    of_turn = (
                        -(left[i, 0] * J[0, j] + left[i, 1] * J[1, j] + left[i, 2] * J[2, j]) / sd
                    )
                    by_parameters[t, s, i, 3 * s + j] = -turns.dt * of_turn
                    for c in range(3):
                        by_parameters[t, s, i, 3 * S + 9 * s + 3 * j + c] = (
                            of_turn * turns.read[t, s, c]
                        )
                    late += of_turn * turns.later[t, s, j]
                by_parameters[t, s, i, 12 * S] = late


@inlined
def _inverse_jacobian(v: Array, sign: float, J: Array) -> None:
    """Fill J (3, 3), the inverse of the right Jacobian of sign v (3,). Source: Sola et al. 2018, (144)."""
    x, y, z = sign * v[0], sign * v[1], sign * v[2]
    square = x * x + y * y + z * z
    size = np.sqrt(square)
    b = 1 / 12 + square / 720
    if size >= 1e-3:
        b = 1 / square - (1 + np.cos(size)) / (2 * size * np.sin(size))
    J[0, 0], J[0, 1], J[0, 2] = 1 - b * (y * y + z * z), b * x * y - 0.5 * z, b * x * z + 0.5 * y
    J[1, 0], J[1, 1], J[1, 2] = b * x * y + 0.5 * z, 1 - b * (x * x + z * z), b * y * z - 0.5 * x
    J[2, 0], J[2, 1], J[2, 2] = b * x * z - 0.5 * y, b * y * z + 0.5 * x, 1 - b * (x * x + y * y)


@looped
def fill_hinges(
    tree: Tree,
    motion: Motion,
    axes: Axes,
    skin_turn: Array,
    sd: float,
    r: Array,
    by_turns: Array,
    by_parameters: Array,
) -> None:
    """Residuals (T, H, 3) of hinges and their derivatives (T, H, 3, S, 3), (T, H, 3, 4 H + 6 J), in standard deviations; elements that are always zero are not written.

    An empty `by_turns` asks for the residuals alone.
    """
    H, J = axes.joints.shape[0], tree.parents.shape[0]
    axis_now, moved, axis_by_tilt, turned = (
        np.empty(3),
        np.empty(3),
        np.empty((3, 3)),
        np.empty((3, 3)),
    )
    for t in range(r.shape[0]):
        for h in range(H):
            for side in range(2):
                s, sign, axis = tree.parents[axes.joints[h]], 1.0 / sd, axes.far[h]
                along, own = axes.far_tangents[h], 2 * h
                if side:
                    s, sign, axis = tree.children[axes.joints[h]], -1.0 / sd, axes.near[h]
                    along, own = axes.near_tangents[h], 2 * H + 2 * h
                R, back = motion.R[t, s], motion.back[t, s]
                for i in range(3):
                    axis_now[i] = back[i, 0] * axis[0] + back[i, 1] * axis[1] + back[i, 2] * axis[2]
                for i in range(3):
                    u, v, w = sign * R[i, 0], sign * R[i, 1], sign * R[i, 2]
                    before = r[t, h, i] if side else 0.0
                    r[t, h, i] = before + u * axis_now[0] + v * axis_now[1] + w * axis_now[2]
                    if by_turns.shape[0] == 0:
                        continue
                    by_turns[t, h, i, s, 0] = w * axis_now[1] - v * axis_now[2]
                    by_turns[t, h, i, s, 1] = u * axis_now[2] - w * axis_now[0]
                    by_turns[t, h, i, s, 2] = v * axis_now[0] - u * axis_now[1]
                    for j in range(3):
                        axis_by_tilt[i, j] = u * back[0, j] + v * back[1, j] + w * back[2, j]
                    for j in range(2):
                        by_parameters[t, h, i, own + j] = (
                            axis_by_tilt[i, 0] * along[0, j]
                            + axis_by_tilt[i, 1] * along[1, j]
                            + axis_by_tilt[i, 2] * along[2, j]
                        )
                m = tree.before[s]
                if m < 0 or by_turns.shape[0] == 0:
                    continue
                bent = motion.bent[t, m]
                for j in range(3):  # [axis]x times the right Jacobian
                    x, y, z = (
                        motion.turning[t, s, 0, j],
                        motion.turning[t, s, 1, j],
                        motion.turning[t, s, 2, j],
                    )
                    turned[0, j] = axis[1] * z - axis[2] * y
                    turned[1, j] = axis[2] * x - axis[0] * z
                    turned[2, j] = axis[0] * y - axis[1] * x
                moved[0] = skin_turn[m, 1] * axis[2] - skin_turn[m, 2] * axis[1]
                moved[1] = skin_turn[m, 2] * axis[0] - skin_turn[m, 0] * axis[2]
                moved[2] = skin_turn[m, 0] * axis[1] - skin_turn[m, 1] * axis[0]
                for i in range(3):
                    u, v, w = (
                        axis_by_tilt[i, 0],
                        axis_by_tilt[i, 1],
                        axis_by_tilt[i, 2],
                    )
                    for j in range(3):
                        by_parameters[t, h, i, 4 * H + 3 * m + j] = bent * (
                            u * turned[0, j] + v * turned[1, j] + w * turned[2, j]
                        )
                    by_bent = -(u * moved[0] + v * moved[1] + w * moved[2])
                    for j in range(2):
                        by_parameters[t, h, i, 4 * H + 3 * J + 2 * m + j] = (
                            by_bent * motion.by_bending[t, m, j]
                        )
                    by_parameters[t, h, i, 4 * H + 5 * J + m] = by_bent * motion.by_bending[t, m, 2]


@looped
def fill_joint_accelerations(
    tree: Tree,
    motion: Motion,
    arms: Arms,
    weights: Array,
    white: Array,
    by_turns: Array,
    by_parameters: Array,
) -> None:
    """Derivatives (T, J, 3, KNOTS, S, 3) and (T, J, 3, 15 J + 12 S), whitened by (T, J, J), of the difference of each joint's acceleration between parent and child.

    `weights` (2, KNOTS): of three samples in a second difference, and in the mean of accelerations.
    """
    J, S = white.shape[1], motion.R.shape[1]
    count, scratch = 15 * J + 12 * S, np.empty((4, 3, 3))
    turns, parameters = np.zeros((J, 3, KNOTS * S * 3)), np.zeros((J, 3, count))
    place_by_turn = np.empty(
        (KNOTS, 2 * J, 3, 3)
    )  # of three samples: by the turn of a side's sensor
    place_by_parameters = np.empty(
        (KNOTS, 2 * J, 3, 12)
    )  # by arm, skin's turn and slide, tilt and law
    force_by_turn, force_by_errors = (
        np.empty((KNOTS, S, 3, 3)),
        np.empty((KNOTS, S, 3, 12)),
    )  # of a sensor
    for sample in range(motion.R.shape[0]):
        ring = sample % KNOTS
        for s in range(S):
            _fill_force_derivatives(
                sample, s, motion, force_by_turn[ring, s], force_by_errors[ring, s]
            )
        for k in range(J):
            for side in range(2):
                s = tree.parents[k] if side else tree.children[k]
                arm = arms.far[k] if side else arms.near[k]
                _fill_place_derivatives(
                    sample,
                    s,
                    tree.before[s],
                    motion,
                    arm,
                    arms,
                    scratch,
                    (place_by_turn[ring, 2 * k + side], place_by_parameters[ring, 2 * k + side]),
                )
        t = sample - KNOTS + 1
        if t < 0:
            continue
        parameters[:] = 0.0
        for k in range(J):
            for side in range(2):
                s, sign = tree.children[k], 1.0
                place = 3 * J + 3 * k
                if side:
                    s, sign, place = tree.parents[k], -1.0, 3 * k
                for knot in range(KNOTS):
                    ring = (t + knot) % KNOTS
                    a, b, column = (
                        sign * weights[0, knot],
                        sign * weights[1, knot],
                        (knot * S + s) * 3,
                    )
                    for i in range(3):
                        for j in range(3):
                            turns[k, i, column + j] = -(
                                a * place_by_turn[ring, 2 * k + side, i, j]
                                + b * force_by_turn[ring, s, i, j]
                            )
                    _add_columns(
                        (k, s, place, tree.before[s]),
                        a,
                        place_by_parameters[ring, 2 * k + side],
                        b,
                        force_by_errors[ring, s],
                        parameters,
                    )
        for k in range(J):
            _whiten_rows(k, white[t], turns, by_turns[t])
            _whiten_rows(k, white[t], parameters, by_parameters[t])


@inlined
def _fill_force_derivatives(
    sample: int, s: int, motion: Motion, force_by_turn: Array, force_by_errors: Array
) -> None:
    """R [f]x (3, 3), and the derivatives (3, 12) of a specific force by bias and scale, but for their sign."""
    R, f, read = motion.R, motion.force, motion.read
    for i in range(3):
        x, y, z = R[sample, s, i, 0], R[sample, s, i, 1], R[sample, s, i, 2]
        force_by_turn[i, 0] = y * f[sample, s, 2] - z * f[sample, s, 1]
        force_by_turn[i, 1] = z * f[sample, s, 0] - x * f[sample, s, 2]
        force_by_turn[i, 2] = x * f[sample, s, 1] - y * f[sample, s, 0]
        force_by_errors[i, 0], force_by_errors[i, 1], force_by_errors[i, 2] = x, y, z
        for c in range(3):
            force_by_errors[i, 3 + c] = x * read[sample, s, c]
            force_by_errors[i, 6 + c] = y * read[sample, s, c]
            force_by_errors[i, 9 + c] = z * read[sample, s, c]


@inlined
def _fill_place_derivatives(
    sample: int,
    s: int,
    m: int,
    motion: Motion,
    arm: Array,
    arms: Arms,
    scratch: Array,
    filled: tuple[Array, Array],
) -> None:
    """R [p]x (3, 3) of the place p of a joint in a sensor's frame, and that place's derivatives (3, 12) in the global frame."""
    place_by_turn, place_by_parameters = filled
    R, back = motion.R, motion.back
    x, y, z = (
        arm[0] - motion.slide[sample, s, 0],
        arm[1] - motion.slide[sample, s, 1],
        arm[2] - motion.slide[sample, s, 2],
    )
    seen, moved = scratch[0, 0], scratch[0, 1]
    for i in range(3):
        seen[i] = back[sample, s, i, 0] * x + back[sample, s, i, 1] * y + back[sample, s, i, 2] * z
    for i in range(3):
        u, v, w = R[sample, s, i, 0], R[sample, s, i, 1], R[sample, s, i, 2]
        place_by_turn[i, 0] = v * seen[2] - w * seen[1]
        place_by_turn[i, 1] = w * seen[0] - u * seen[2]
        place_by_turn[i, 2] = u * seen[1] - v * seen[0]
        for j in range(3):
            place_by_parameters[i, j] = (
                u * back[sample, s, 0, j] + v * back[sample, s, 1, j] + w * back[sample, s, 2, j]
            )
    if m < 0:
        return
    bent, J, turn, slide = motion.bent[sample, m], motion.turning, arms.skin_turn, arms.skin_slide
    for j in range(3):  # [off]x times the right Jacobian
        scratch[1, 0, j] = y * J[sample, s, 2, j] - z * J[sample, s, 1, j]
        scratch[1, 1, j] = z * J[sample, s, 0, j] - x * J[sample, s, 2, j]
        scratch[1, 2, j] = x * J[sample, s, 1, j] - y * J[sample, s, 0, j]
    moved[0] = turn[m, 1] * z - turn[m, 2] * y + slide[m, 0]
    moved[1] = turn[m, 2] * x - turn[m, 0] * z + slide[m, 1]
    moved[2] = turn[m, 0] * y - turn[m, 1] * x + slide[m, 2]
    for i in range(3):
        u, v, w = place_by_parameters[i, 0], place_by_parameters[i, 1], place_by_parameters[i, 2]
        for j in range(3):
            place_by_parameters[i, 3 + j] = bent * (
                u * scratch[1, 0, j] + v * scratch[1, 1, j] + w * scratch[1, 2, j]
            )
            place_by_parameters[i, 6 + j] = -bent * place_by_parameters[i, j]
        by_bent = -(u * moved[0] + v * moved[1] + w * moved[2])
        for j in range(3):
            place_by_parameters[i, 9 + j] = by_bent * motion.by_bending[sample, m, j]


@inlined
def _add_columns(
    own: tuple[int, int, int, int],
    a: float,
    place_by_parameters: Array,
    b: float,
    force_by_errors: Array,
    parameters: Array,
) -> None:
    """One sample's share in the derivatives of joint k, seen by sensor s that skin moves with joint m, by parameters, in place."""
    k, s, place, m = own
    J = parameters.shape[0]
    S = (parameters.shape[2] - 15 * J) // 12
    bias, scale = 15 * J + 3 * s, 15 * J + 3 * S + 9 * s
    for i in range(3):
        for j in range(3):
            parameters[k, i, place + j] += a * place_by_parameters[i, j]
            parameters[k, i, bias + j] -= b * force_by_errors[i, j]
        for j in range(9):
            parameters[k, i, scale + j] += b * force_by_errors[i, 3 + j]
        if m >= 0:
            for j in range(3):
                parameters[k, i, 6 * J + 3 * m + j] += a * place_by_parameters[i, 3 + j]
                parameters[k, i, 9 * J + 3 * m + j] += a * place_by_parameters[i, 6 + j]
            for j in range(2):
                parameters[k, i, 12 * J + 2 * m + j] += a * place_by_parameters[i, 9 + j]
            parameters[k, i, 14 * J + m] += a * place_by_parameters[i, 11]


@inlined
def _whiten_rows(k: int, white: Array, rows: Array, out: Array) -> None:
    """Row k of a lower triangular matrix times blocks of three rows."""
    for i in range(3):
        for j in range(rows.shape[2]):
            out[k, i, j] = white[k, k] * rows[k, i, j]
        for other in range(k):
            w = white[k, other]
            for j in range(rows.shape[2]):
                out[k, i, j] += w * rows[other, i, j]
