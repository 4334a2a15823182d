"""Fixed-interval smoother of a tracked recording.

In      readings of a whole recording, filtered by tracker.py with a trace (history.py)
Out     the same track with smoothed states and standard deviations; flags, signal and latency as
        filtered
Source  Rauch, Tung & Striebel 1965, AIAA Journal 3:1445, for the motion errors of trunk and hand:
        filtered positions jump with every reading, and jumps would count as movement
Limits  declared values stay as the filter estimated them; readings more than two times `ROWS` later
        have no influence; nothing is smoothed across a gap or a relocation of the hand
"""

from dataclasses import replace

import numpy as np

from handscope.estimators.magnet.tracker.history import Trace, make_trace, split_covariance
from handscope.estimators.magnet.tracker.initialisation import declared_values
from handscope.estimators.magnet.tracker.options import MagnetParams
from handscope.estimators.magnet.tracker.state import ERROR, OWN, STATE, inject_error, rows
from handscope.estimators.magnet.tracker.tracker import (
    Readings,
    State,
    Track,
    join_tracks,
    select_readings,
    step,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.small_matrices import put, spread
from handscope.estimators.numerics.typing import Array

ROWS = 4000  # samples of a chunk: 40 s at 100 Hz


def smooth(params: MagnetParams, state: State, readings: Readings) -> tuple[State, Track]:
    """Filter and smooth a whole recording; errors as `tracker.step`."""
    size = STATE.moment + len(declared_values(state.setup))
    behind: tuple[Track, Trace] | None = None
    done: list[Track] = []
    for first in range(0, max(len(readings.t), 1), ROWS):
        here = select_readings(readings, slice(first, first + ROWS))
        trace = make_trace(len(here.t), size)
        state, track = step(params, state, here, trace)
        _cut_at_doubtful(track, trace, behind)
        if behind is not None:
            done.append(_smooth_chunk(state, *behind, trace))
        behind = track, trace
    assert behind is not None
    done.append(_smooth_chunk(state, *behind, make_trace(0, size)))
    return state, join_tracks(done)


def _cut_at_doubtful(track: Track, trace: Trace, before: tuple[Track, Trace] | None) -> None:
    """Decouple doubtful samples from their neighbours."""
    cut = track.doubtful.copy()
    cut[1:] |= track.doubtful[:-1]
    if before is not None and len(cut):
        cut[0] |= before[0].doubtful[-1]
        trace.open[:1][cut[:1]] = before[1].own[-1]
    trace.open[1:][cut[1:]] = trace.own[:-1][cut[1:]]
    trace.gain[cut] = 0.0


def _smooth_chunk(end: State, track: Track, trace: Trace, later: Trace) -> Track:
    """The track smoothed by its own and later readings, up to the filter's newest state."""
    if end.x is None or not len(track):
        return track
    news, cov, lasting = np.zeros(OWN), np.empty((OWN, OWN)), np.empty((OWN, OWN))
    _split_newest(end.covariance, cov, lasting)
    for piece in (later, trace):
        x, variances = np.empty_like(piece.state), np.empty_like(piece.lasting)
        rts_backward_pass(piece, news, cov, x, variances)
    with np.errstate(invalid="ignore", divide="ignore"):
        filtered = trace.own[:, :1, 0] + trace.lasting[:, :1]
        sd = np.sqrt(variances) * (
            track.p_sd[:, :1] / np.sqrt(filtered)
        )  # inflated as the filter's
    return replace(
        track,
        p_bt=x[:, rows(STATE.p_bt)],
        v_bt=x[:, rows(STATE.v_bt)],
        q_bt=x[:, rows(STATE.q_bt, 4)],
        q_gb=x[:, rows(STATE.q_gb, 4)],
        field=x[:, rows(STATE.B_g)],
        p_sd=sd[:, rows(ERROR.p_bt)],
        v_sd=sd[:, rows(ERROR.v_bt)],
        q_bt_sd=sd[:, rows(ERROR.th_bt)],
        q_gb_sd=sd[:, rows(ERROR.th_gb)],
    )


@looped
def _split_newest(P: Array, own: Array, lasting: Array) -> None:
    """`split_covariance`, kept as machine code: called from Python it would be translated by every process."""
    split_covariance(P, own, lasting)


@looped
def rts_backward_pass(
    trace: Trace, news: Array, cov: Array, states: Array, variances: Array
) -> None:
    """Fill states (n, 45 + 6 L) and variances (n, 30) of the trace's samples. `news` (30,), the
    correction of the filter's last state, and `cov` (30, 30), its covariance without lasting
    errors, become those of the sample before the first."""
    C, open_, carried, difference = (
        np.empty((OWN, OWN)),
        np.empty((OWN, OWN)),
        np.empty((OWN, OWN)),
        np.empty(OWN),
    )
    for n in range(len(states) - 1, -1, -1):
        x = inject_error(trace.state[n], news)
        state_difference(x, trace.expected[n], difference)
        put(trace.gain[n], C)
        put(trace.open[n], open_)
        for i in range(len(x)):
            states[n, i] = x[i]
        for i in range(OWN):
            variances[n, i], news[i] = cov[i, i] + trace.lasting[n, i], 0.0
        spread(C, cov, carried)
        for i in range(OWN):
            for j in range(OWN):
                cov[i, j] = open_[i, j] + carried[i, j]
                if C[i, j] != 0.0:
                    news[i] += C[i, j] * difference[j]


@inlined
def state_difference(x: Array, other: Array, difference: Array) -> None:
    """Fill the errors (30,) that `inject_error` needs to go from `other` to x."""
    for i in range(3):
        difference[ERROR.p_bt + i], difference[ERROR.v_bt + i] = (
            x[i] - other[i],
            x[STATE.v_bt + i] - other[STATE.v_bt + i],
        )
        difference[ERROR.B_g + i] = x[STATE.B_g + i] - other[STATE.B_g + i]
        difference[ERROR.gyr_bias_t + i], difference[ERROR.acc_bias_t + i] = (
            x[STATE.gyr_bias_t + i] - other[STATE.gyr_bias_t + i],
            x[STATE.acc_bias_t + i] - other[STATE.acc_bias_t + i],
        )
        difference[ERROR.gyr_bias_b + i], difference[ERROR.acc_bias_b + i] = (
            x[STATE.gyr_bias_b + i] - other[STATE.gyr_bias_b + i],
            x[STATE.acc_bias_b + i] - other[STATE.acc_bias_b + i],
        )
        difference[ERROR.v_b + i] = x[STATE.v_b + i] - other[STATE.v_b + i]
    rotation_difference(
        other[STATE.q_bt : STATE.q_bt + 4],
        x[STATE.q_bt : STATE.q_bt + 4],
        difference[ERROR.th_bt : ERROR.th_bt + 3],
    )
    rotation_difference(
        other[STATE.q_gb : STATE.q_gb + 4],
        x[STATE.q_gb : STATE.q_gb + 4],
        difference[ERROR.th_gb : ERROR.th_gb + 3],
    )


@inlined
def rotation_difference(from_q: Array, to_q: Array, turn: Array) -> None:
    """Fill the rotation vector (3,) from one orientation to another, body axes."""
    q = np.empty(4)
    quat.relative_row(from_q, to_q, q)
    quat.log_row(q, turn, turn)
