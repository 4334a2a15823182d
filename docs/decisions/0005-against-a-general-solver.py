"""The solver of self-calibration beside scipy's on the same problem: python docs/decisions/0005-against-a-general-solver.py [seconds of movement ...]."""

import sys
import time
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import coo_array, csr_array

from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import initialisation as self_calibration_initialisation
from handscope.estimators.self_calibration import residuals, soft_tissue, solver
from handscope.estimators.self_calibration.problem import (
    Noise,
    Problem,
    Readings,
    Unknowns,
    Z,
    apply_increment,
    axis_in_sensors,
    build_chain,
    build_problem,
    parameter_columns,
    tangents,
    tilt_axes,
    with_flexion,
)
from handscope.estimators.simulation import artificial_finger
from handscope.estimators.simulation.sensors import IDEAL

LINKED = build_chain(artificial_finger.SEGMENTS, hinges=("index_mcp", "index_pip", "index_dip"))


def compared(duration: float) -> str:
    """One finger of so many seconds, both solvers from the same start to the same relations (the joints' bending as at the start)."""
    errors = replace(IDEAL, gyr_noise=0.01, acc_noise=300e-6, gyr_bias=0.5, acc_bias=0.05)
    made = artificial_finger.record_trial(np.random.default_rng(0), errors, duration=duration)
    block = made.samples["imu"]
    sure = np.ones(block.values.shape[:2])
    read = Readings(1 / block.stream.rate, block.of("gyr"), block.of("acc"), sure, sure)
    guess = self_calibration_initialisation.initial_unknowns(
        LINKED, Noise(), read, axis_in_sensors(LINKED, made.mounting, Z)
    )
    problem = with_flexion(
        build_problem(LINKED, Noise(), read, guess.q_GS[0], made.hand, made.mounting), guess
    )
    began = time.process_time()
    ours = solver.solve(problem, guess)
    us = time.process_time() - began
    general, n = (
        replace(ours.problem),
        len(problem) * 3 * len(LINKED.sensors) + parameter_columns(LINKED).count,
    )
    return (
        f"{duration:g} s, {n} unknowns: ours {us:.1f} s, {len(ours.costs) - 1} steps, cost {solver.cost(general, ours.at):.4f}; "
        f"scipy from the same start {_general(general, guess, ours.at)}; from our minimum {_general(general, ours.at, ours.at)}"
    )


def _general(problem: Problem, here: Unknowns, ours: Unknowns) -> str:
    """What scipy's solver makes of it from `here`, and how far that is from ours."""
    began = time.process_time()
    theirs = least_squares(
        lambda x: _rows(problem, _at(problem, here, x)),
        np.zeros(len(problem) * 3 * len(LINKED.sensors) + parameter_columns(LINKED).count),
        lambda x: _slopes(problem, here, x),
        method="trf",
        x_scale="jac",
        tr_solver="lsmr",
        tr_options={"atol": 1e-10, "btol": 1e-10, "maxiter": 3000},
        ftol=1e-9,
        xtol=1e-12,
        gtol=1e-10,
        max_nfev=60,
    )
    them, there = time.process_time() - began, _at(problem, here, theirs.x)
    apart = np.abs(np.concatenate([ours.far - there.far, ours.near - there.near])).max()
    return (
        f"{them:.1f} s, {theirs.nfev} evaluations, cost {theirs.cost:.4f} (status {theirs.status}), "
        f"joints' places {1e6 * apart:.1f} um from ours at most"
    )


def _at(problem: Problem, here: Unknowns, x: Array) -> Unknowns:
    n = len(problem) * 3 * len(LINKED.sensors)
    return apply_increment(here, LINKED, x[:n].reshape(len(problem), -1, 3), x[n:])


def _rows(problem: Problem, at: Unknowns) -> Array:
    parts = [kind(problem, at, 0, len(problem)).r.ravel() for kind in residuals.EVERY_SAMPLE]
    return np.concatenate([*parts, residuals.prior_residuals(problem, at)[0]])


def _slopes(problem: Problem, here: Unknowns, x: Array) -> csr_array:
    """Derivatives by the increment from `here`, sparse; what an increment of a rotation or a direction does where it is large is part of it."""
    at, S = _at(problem, here, x), len(LINKED.sensors)
    e, n, P = 3 * S, len(problem) * 3 * S, parameter_columns(LINKED).count
    turning = soft_tissue.right_jacobian(x[:n].reshape(len(problem), S, 3))
    of_parameters = _of_axes(here, x[n:])
    rows, cols, values, first = [], [], [], 0
    for kind in residuals.EVERY_SAMPLE:
        terms = kind(problem, at, 0, len(problem))
        T, m = terms.r.shape
        row = first + np.arange(T * m).reshape(T, m, 1)
        for k in range(terms.knots):
            J = terms.by_turns[:, :, k * e : (k + 1) * e].reshape(T, m, S, 3)
            J = np.einsum(
                "tmsi,tsij->tmsj", J, turning[terms.first + k : terms.first + k + T]
            ).reshape(T, m, e)
            col = ((terms.first + k + np.arange(T)) * e)[:, None, None] + np.arange(e)
            _put(rows, cols, values, row, col, J)
        whole = np.zeros((T, m, P))
        whole[:, :, terms.cols] = terms.by_parameters
        _put(
            rows,
            cols,
            values,
            row,
            np.broadcast_to(n + np.arange(P), (T, 1, P)),
            whole @ of_parameters,
        )
        first += T * m
    J = residuals.prior_residuals(problem, at)[1] @ of_parameters
    _put(
        rows,
        cols,
        values,
        (first + np.arange(len(J)))[None, :, None],
        (n + np.arange(P))[None, None],
        J[None],
    )
    return coo_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))),
        shape=(first + len(J), n + P),
    ).tocsr()


def _put(
    rows: list[Array], cols: list[Array], values: list[Array], row: Array, col: Array, value: Array
) -> None:
    r, c, v = np.broadcast_arrays(row, col, value)
    told = v != 0
    rows.append(r[told])
    cols.append(c[told])
    values.append(v[told])


def _of_axes(here: Unknowns, x: Array) -> Array:
    """What an increment of the parameters is in the tangents of the place that it leads to (P, P)."""
    c, whole = parameter_columns(LINKED), np.eye(len(x))
    for where, axes in ((c.axis_far, here.axis_far), (c.axis_near, here.axis_near)):
        by = x[where].reshape(-1, 2)
        frame = tangents(tilt_axes(axes, by))
        for k in range(2):
            d = np.zeros_like(by)
            d[:, k] = 1e-6
            slope = np.einsum(
                "mij,mi->mj", frame, (tilt_axes(axes, by + d) - tilt_axes(axes, by - d)) / 2e-6
            )
            for h in range(len(by)):
                whole[where.start + 2 * h : where.start + 2 * h + 2, where.start + 2 * h + k] = (
                    slope[h]
                )
    return whole


if __name__ == "__main__":
    for seconds in [float(a) for a in sys.argv[1:]] or [5.0, 10.0, 20.0]:
        sys.stdout.write(compared(seconds) + "\n")
        sys.stdout.flush()
