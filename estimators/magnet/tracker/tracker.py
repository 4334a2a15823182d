"""Position and orientation of the hand against the trunk, from a magnet on the hand and
magnetometers on the trunk, live and in batch.

In      Readings: inertial samples of trunk (base b) and hand (target t), calibrated magnetometers
        on the trunk; a Setup
Out     Track at every sample: p_bt, v_bt, q_bt, q_gb, ambient field, standard deviations, signal,
        flags
Source  Kortier, thesis ch. 5: error-state filter (5.2), dipole (5.7)-(5.15), accelerometers (5.16),
        (5.17), standstill and workspace (5.18), process (5.19)-(5.22), signal (5.23); standstill
        test: Skog et al. 2010. Arithmetic: state.py, inertial_updates.py, latency.py,
        magnetic_update.py, update_cycle.py
Frames  g: z up, y along the horizontal ambient field; v_bt is the difference of the velocities
        against g, in axes of b
Limits  one magnetometer cannot separate the ambient field from the magnet's while the trunk turns;
        the field must be homogeneous over the array. An undeclared magnet is flagged, not tracked
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.special import gammaincc

from handscope.estimators.errors import InputError
from handscope.estimators.magnet.model.setup import (
    EARTH_STRONGEST,
    EARTH_WEAKEST,
    Constellation,
    Magnet,
    require_field,
)
from handscope.estimators.magnet.tracker import initialisation as magnet_initialisation
from handscope.estimators.magnet.tracker import standstill as magnet_standstill
from handscope.estimators.magnet.tracker.history import Trace, make_trace, slice_trace
from handscope.estimators.magnet.tracker.initialisation import Setup
from handscope.estimators.magnet.tracker.latency import (
    Kinematics,
    copy_kinematics,
    start_kinematics,
)
from handscope.estimators.magnet.tracker.monitor import LOST_SD, InnovationMonitor
from handscope.estimators.magnet.tracker.options import DEG, MagnetParams, noise_model
from handscope.estimators.magnet.tracker.state import ERROR, LATENCY, OWN, STATE
from handscope.estimators.magnet.tracker.update_cycle import (
    FilterInputs,
    FilterOutputs,
    FilterState,
    run_filter,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array, Bools

ORDINARY_SD = 2.5  # standard deviations: the largest of some thirty normal errors
# complete readings that measure the noise: to 7 %, then to 3 % with four magnetometers
NOISE_COUNTS = 32, 256
QUARTILE = 1.1503  # standard deviations: three quarters of normal errors are smaller
NOTICED_NOISE = 1.1  # times the declared noise, above which the measured one counts
RESTART_NOISE = 1.5  # times the declared noise, above which the filter restarts


@dataclass(frozen=True)
class Readings:
    """Samples of any number, 0 included."""

    t: Array  # (n,) s
    base: Array  # (n, 6) gyroscope rad/s, accelerometer m/s^2, base frame
    target: Array  # (n, 6) the same, target frame
    mag: Array  # (n, magnetometers, 3) T, calibrated, each in its own axes; NaN where none
    age: Array | None = None  # (n, magnetometers) s since each was read; None: 0


@dataclass(frozen=True)
class State:
    """Everything the next step needs: save it, copy it, start again from it."""

    setup: Setup
    x: Array | None  # (45 + 6 magnetometers,), state.py; None before the first complete sample
    covariance: Array  # (43 + 6 magnetometers,) squared
    monitor: InnovationMonitor
    newest: Array  # (12,) last good inertial readings
    kinematics: Kinematics
    recent: Array  # (m, 12 + 3 magnetometers) for the standstill test
    noise_samples: Array | None  # (m, magnetometers, 3) T, until their noise is measured; then None
    noise: float = 0.0  # uT, where it exceeds the declared noise
    contradicted: float = -np.inf  # s, newest sample at which readings contradicted the setup
    t: float = -np.inf


@dataclass(frozen=True)
class Track:
    """Position (m), velocity (m/s) and orientation of the hand against the trunk, with standard deviations."""

    t: Array  # (n,) s
    p_bt: Array  # (n, 3) m; NaN before the first complete sample, as all
    v_bt: Array  # (n, 3) m/s
    q_bt: Array  # (n, 4)
    q_gb: Array  # (n, 4)
    field: Array  # (n, 3) T, of the environment, global frame
    p_sd: Array  # (n, 3) m
    v_sd: Array  # (n, 3) m/s
    q_bt_sd: Array  # (n, 3) rad, about the axes of t
    q_gb_sd: Array  # (n, 3) rad, about the axes of b
    snr: Array  # (n, magnetometers) dB, (5.23); see signal_strength
    latency: Array  # (n,) s, magnetometers behind inertial sensors; corrected for unless doubtful
    latency_sd: Array  # (n,) s
    nis: Array  # (n,) mean normalised innovation squared; 1 or less if all is as declared
    saturated: Bools  # (n, magnetometers) reading at the limit, left out
    still: Bools  # (n, 2) base, target
    doubtful: Bools  # (n,) readings contradict setup or room (second magnet, iron, calibration): do not use

    def __len__(self) -> int:
        return len(self.t)


def start(setup: Setup) -> State:
    """Before the first sample; InputError where the setup cannot be."""
    if not EARTH_WEAKEST <= setup.earth <= EARTH_STRONGEST:
        raise InputError("magnet.ambient_field_outside", strength=1000000.0 * setup.earth)
    return State(
        setup,
        None,
        np.empty((0, 0)),
        InnovationMonitor(),
        np.full(12, np.nan),
        start_kinematics(len(setup.array)),
        np.empty((0, 12 + setup.array.places.size)),
        np.empty((0, len(setup.array), 3)),
    )


def step(
    params: MagnetParams, state: State, readings: Readings, trace: Trace | None = None
) -> tuple[State, Track]:
    """Advance by samples of any number; results do not depend on where blocks are cut.

    The first readings measure the magnetometers' noise; where it exceeds the declared one,
    estimates made of them are discarded. Fills a trace of as many rows for smoother.py.
    """
    n, many = len(readings.t), len(state.setup.array)
    if (
        readings.mag.shape != (n, many, 3)
        or readings.base.shape != (n, 6)
        or readings.target.shape != (n, 6)
    ):
        raise InputError(
            "magnet.shapes_differ",
            shape=str(readings.mag.shape),
            shape2=str(readings.base.shape),
            shape3=str(readings.target.shape),
            n=n,
            many=many,
        )
    if state.noise_samples is None:
        return _advance(params, state, readings, trace)
    fresh = np.flatnonzero((np.abs(readings.mag) < 0.999e-6 * params.mag_range).all(axis=(1, 2)))
    noise_samples = np.concatenate([state.noise_samples, readings.mag[fresh]])
    enough = next(many for many in NOISE_COUNTS if many > len(state.noise_samples))
    if len(noise_samples) < enough:
        return _advance(params, replace(state, noise_samples=noise_samples), readings, trace)
    cut = int(fresh[enough - 1 - len(state.noise_samples)]) + 1
    state, early = _advance(
        params, state, select_readings(readings, slice(cut)), slice_trace(trace, slice(cut))
    )
    later = slice(cut, None)
    listening = _apply_noise(params, state, noise_samples[:enough])
    begun_anew = listening.x is not state.x
    state, late = step(
        params, listening, select_readings(readings, later), slice_trace(trace, later)
    )
    if begun_anew and trace is not None and cut < len(trace.gain):  # no smoothing across a restart
        trace.gain[cut], trace.open[cut] = 0.0, trace.own[cut - 1]
    return state, join_tracks([early, late])


def _apply_noise(params: MagnetParams, state: State, noise_samples: Array) -> State:
    """With the noise of the readings so far (n, magnetometers, 3); decisions made with another
    noise are dropped."""
    noise, first = 1e6 * _estimate_noise(noise_samples), len(noise_samples) == NOISE_COUNTS[0]
    more = None if len(noise_samples) == NOISE_COUNTS[-1] else noise_samples
    is_louder = noise > RESTART_NOISE * params.mag_noise
    if first and state.x is not None and (is_louder or _is_lost(state)):
        return replace(
            _restart(params, state, noise_samples, max(noise, params.mag_noise)),
            noise_samples=more,
            noise=noise if is_louder else 0.0,
        )
    if noise <= NOTICED_NOISE * params.mag_noise:
        noise = 0.0
    if not noise > max(state.noise, params.mag_noise):
        return replace(state, noise_samples=more, noise=noise)
    monitor = state.monitor._replace(mean_nis=1.0)
    return replace(state, noise_samples=more, noise=noise, monitor=monitor, contradicted=-np.inf)


def _is_lost(state: State) -> bool:
    return (
        float(np.trace(state.covariance[ERROR.p_bt : ERROR.p_bt + 3, ERROR.p_bt : ERROR.p_bt + 3]))
        > LOST_SD**2
    )


def _restart(params: MagnetParams, state: State, noise_samples: Array, noise: float) -> State:
    """Restart at the newest sample with `noise` uT; position from the mean of the readings so far
    (n, magnetometers, 3), if the hand held still."""
    params, restarted = replace(params, mag_noise=noise), start(state.setup)
    near = None
    if not magnet_standstill.detect_field_change(
        noise_samples, len(noise_samples), 1e-6 * noise
    ).any():
        at = Readings(
            np.array([state.t]),
            state.newest[None, :6],
            state.newest[None, 6:],
            noise_samples.mean(axis=0)[None],
        )
        settled = _advance(
            replace(params, mag_noise=noise / np.sqrt(len(noise_samples))), restarted, at, None
        )[0]
        near = (
            None
            if settled.x is None or _is_lost(settled)
            else magnet_initialisation.magnet_in_base(settled.x)
        )
    mag_b = quat.rotate(state.setup.array.q_bl, noise_samples[-1])
    x, P = magnet_initialisation.initial_state(
        params, state.setup, state.newest, noise_samples[-1], mag_b, near
    )
    return replace(
        restarted, x=x, covariance=P, newest=state.newest, recent=state.recent, t=state.t
    )


def _estimate_noise(mag: Array) -> float:
    """White noise, T, of readings (n, magnetometers, 3) by third differences, of which the largest
    quarter may be movement."""
    return float(np.quantile(np.abs(np.diff(mag, n=3, axis=0)), 0.75) / QUARTILE / np.sqrt(20.0))


def _advance(
    params: MagnetParams, state: State, readings: Readings, trace: Trace | None
) -> tuple[State, Track]:
    """Samples over which the magnetometers' noise is constant."""
    params = replace(params, mag_noise=max(params.mag_noise, state.noise))
    array, n, samples = (
        state.setup.array,
        len(readings.t),
        np.concatenate([readings.base, readings.target], axis=1),
    )
    limits = np.tile(np.repeat([params.gyr_range * DEG, params.acc_range * GRAVITY], 3), 2)
    samples = np.where(np.abs(samples) < 0.999 * limits, samples, np.nan)
    with np.errstate(invalid="ignore"):
        saturated = np.asarray((np.abs(readings.mag) >= 0.999e-6 * params.mag_range).any(axis=2))
    mag = np.where(saturated[..., None], np.nan, readings.mag)
    mag_b = quat.rotate(array.q_bl, mag) if n else mag
    first, x, P = 0, state.x, state.covariance
    if x is None:
        whole = np.isfinite(samples).all(axis=1) & np.isfinite(mag).all(axis=(1, 2))
        if not whole.any():
            return replace(state, t=float(readings.t[-1]) if n else state.t), _unknown_track(
                state, readings, 0, n, saturated
            )
        first = int(whole.argmax())
        x, P = magnet_initialisation.initial_state(
            params, state.setup, samples[first], readings.mag[first], mag_b[first]
        )
        state = replace(state, t=float(readings.t[first]), newest=samples[first])
    window, still = magnet_standstill.detect_standstill(
        state.recent,
        samples[first:],
        mag[first:],
        params.still_samples,
        params.still_gyr * DEG,
        params.still_acc,
        1e-6 * params.mag_noise,
    )
    rows, setup = n - first, state.setup
    begin = FilterState(
        x.copy(), P.copy(), state.newest.copy(), copy_kinematics(state.kinematics), state.monitor
    )
    inputs = FilterInputs(
        np.diff(readings.t[first:], prepend=state.t),
        np.ascontiguousarray(samples[first:]),
        np.ascontiguousarray(mag_b[first:]),
        np.ascontiguousarray(_reading_ages(readings)[first:]),
        still,
    )
    outputs = FilterOutputs(
        np.empty((rows, len(x))),
        np.empty((rows, len(P))),
        np.empty(rows),
        slice_trace(trace, slice(first, None)) or make_trace(0, len(x)),
    )
    end = run_filter(
        noise_model(params, magnet_initialisation.array_span(array)),
        magnet_initialisation.workspace_centre(setup),
        begin,
        inputs,
        outputs,
    )
    t = float(readings.t[-1]) if n else state.t
    track = _to_track(
        params,
        setup,
        readings,
        first,
        outputs,
        saturated,
        still,
        mag,
    )
    now = readings.t[first:]
    known = np.concatenate([[state.contradicted], np.where(track.doubtful[first:], now, -np.inf)])
    contradicted = np.maximum.accumulate(known)
    doubtful = np.concatenate(
        [track.doubtful[:first], now - contradicted[1:] <= params.doubtful_time]
    )
    state = replace(
        state,
        x=end.x,
        covariance=end.P,
        monitor=end.monitor,
        newest=end.newest,
        kinematics=end.kinematics,
        recent=window,
        t=t,
    )
    return replace(state, contradicted=float(contradicted[-1])), replace(track, doubtful=doubtful)


def finish(params: MagnetParams, state: State) -> tuple[State, Track]:
    """Nothing waits; for the interface that every tracker has."""
    nothing = Readings(
        np.empty(0), np.empty((0, 6)), np.empty((0, 6)), np.empty((0, len(state.setup.array), 3))
    )
    return state, _unknown_track(state, nothing, 0, 0, np.empty((0, len(state.setup.array)), bool))


def track_readings(params: MagnetParams, setup: Setup, readings: Readings) -> Track:
    """A whole recording at once, by the same steps as live; InputError where the readings cannot be
    T."""
    require_field(readings.mag)
    return step(params, start(setup), readings)[1]


def estimated_setup(state: State) -> Setup:
    """The setup with the estimated moment, magnet position and constellation, for the next
    recording with the same plate and magnet. Accuracy depends on the movement: half a minute of
    picking and placing gives the moment to 4 %, the position hardly."""
    if state.x is None:
        return state.setup
    x, places = state.x, STATE.residuals + state.setup.array.places.size
    array = Constellation(x[places:LATENCY].reshape(-1, 3).copy(), state.setup.array.q_bl)
    moment, lever = x[STATE.moment : STATE.moment + 3], x[STATE.lever : STATE.lever + 3]
    return replace(state.setup, array=array, magnet=Magnet(moment.copy(), lever.copy()))


def signal_strength(mag: Array, earth: float) -> Array:
    """(5.23), dB: 20 log10 of the readings' strength (..., 3) over the earth's.

    0 is the earth's field alone; +0.5 is 6 % more, a magnet of 0.3 A m^2 at about 28 cm; +6 twice
    the earth's. Below 0 the magnet weakens the earth's field: no measure of accuracy, p_sd is.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(20 * np.log10(np.linalg.norm(mag, axis=-1) / earth))


def deviation_p_value(deviations: Array, remaining: Array) -> Array:
    """Probability (n,) that normal errors deviate together as far as `deviations` (n, k);
    `remaining` (n, k) is the posterior sd, both in prior standard deviations. 1 - remaining^2 of
    each of k errors is estimated: their sum of squares is chi-squared of that many, or less
    scattered."""
    count = np.maximum(1.0 - remaining**2, 0.0).sum(axis=1)
    return np.asarray(gammaincc(0.5 * np.maximum(count, 1.0), 0.5 * (deviations**2).sum(axis=1)))


def _to_track(
    params: MagnetParams,
    setup: Setup,
    readings: Readings,
    first: int,
    outputs: FilterOutputs,
    saturated: Bools,
    still: Bools,
    mag: Array,
) -> Track:
    x, mean_nis = outputs.x, outputs.mean_nis
    sd, field = np.sqrt(np.maximum(outputs.variance, 0.0)), x[:, STATE.B_g : STATE.B_g + 3]
    sds = magnet_initialisation.declared_sds(params, setup)
    deviations = np.abs(x[:, STATE.moment :] - magnet_initialisation.declared_values(setup)) / sds
    p_value = deviation_p_value(deviations[:, :-1], sd[:, OWN:-1] / sds[:-1])
    largest = deviations[:, :-1].max(axis=1)  # largest deviation from a declared value
    sd = sd * np.maximum(1.0, largest / ORDINARY_SD)[:, None]
    strange = (
        np.abs(np.linalg.norm(field, axis=1) / setup.earth - 1.0) > 0.2
    )  # iron or a magnet that the filter takes for the ambient field
    rest = Track(
        readings.t[first:],
        x[:, STATE.p_bt : STATE.p_bt + 3],
        x[:, STATE.v_bt : STATE.v_bt + 3],
        x[:, STATE.q_bt : STATE.q_bt + 4],
        x[:, STATE.q_gb : STATE.q_gb + 4],
        field,
        sd[:, ERROR.p_bt : ERROR.p_bt + 3],
        sd[:, ERROR.v_bt : ERROR.v_bt + 3],
        sd[:, ERROR.th_bt : ERROR.th_bt + 3],
        sd[:, ERROR.th_gb : ERROR.th_gb + 3],
        signal_strength(mag[first:], setup.earth),
        x[:, -1],
        sd[:, -1],
        mean_nis,
        saturated[first:],
        still,
        (mean_nis > params.nis_limit)
        | strange
        | (deviations.max(axis=1) > params.deviation_limit)
        | (p_value < params.min_p_value)
        | (len(setup.array) < 2),
    )
    if not first:
        return rest
    return join_tracks([_unknown_track(start(setup), readings, 0, first, saturated), rest])


def join_tracks(pieces: Sequence[Track]) -> Track:
    """One after the other."""
    return Track(*(np.concatenate([getattr(p, f.name) for p in pieces]) for f in fields(Track)))


def select_readings(readings: Readings, rows: slice) -> Readings:
    """Some of the readings."""
    age = None if readings.age is None else readings.age[rows]
    return Readings(
        readings.t[rows], readings.base[rows], readings.target[rows], readings.mag[rows], age
    )


def _reading_ages(readings: Readings) -> Array:
    return np.zeros(readings.mag.shape[:2]) if readings.age is None else readings.age


def _unknown_track(
    state: State, readings: Readings, first: int, last: int, saturated: Bools
) -> Track:
    """Samples before the filter could start: nothing is known."""
    n = last - first
    v, q = np.full((n, 3), np.nan), np.full((n, 4), np.nan)
    silent = np.full((n, len(state.setup.array)), np.nan)
    never = np.zeros((n, 2), bool)
    return Track(
        readings.t[first:last],
        v,
        v,
        q,
        q,
        v,
        v,
        v,
        v,
        v,
        silent,
        v[:, 0],
        v[:, 0],
        v[:, 0],
        saturated[first:last],
        never,
        np.ones(n, bool),
    )
