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
from handscope.estimators.magnet.tracker.state import ERROR, LATENCY, OWN, STATE, rows
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
    _check_shapes(state, readings)
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


def _check_shapes(state: State, readings: Readings) -> None:
    """InputError where the readings are not of one length, or not of the setup's magnetometers."""
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
    return float(np.trace(state.covariance[rows(ERROR.p_bt), rows(ERROR.p_bt)])) > LOST_SD**2


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


@dataclass(frozen=True)
class _Usable:
    """Readings, NaN where a sensor was at its limit or did not answer."""

    t: Array  # (n,) s
    samples: Array  # (n, 12)
    mag: Array  # (n, magnetometers, 3) T
    mag_b: Array  # (n, magnetometers, 3) T, base axes
    age: Array  # (n, magnetometers) s
    saturated: Bools  # (n, magnetometers)


def _advance(
    params: MagnetParams, state: State, readings: Readings, trace: Trace | None
) -> tuple[State, Track]:
    """Samples over which the magnetometers' noise is constant."""
    params = replace(params, mag_noise=max(params.mag_noise, state.noise))
    usable = _usable_readings(params, state.setup.array, readings)
    first, state = _initialise(params, state, usable)
    if state.x is None:
        return state, _unknown_track(state, readings, first, usable.saturated)
    unknown = _unknown_track(state, readings, first, usable.saturated) if first else None
    usable = _Usable(*(getattr(usable, f.name)[first:] for f in fields(_Usable)))
    recent, still = magnet_standstill.detect_standstill(
        state.recent,
        usable.samples,
        usable.mag,
        params.still_samples,
        params.still_gyr * DEG,
        params.still_acc,
        1e-6 * params.mag_noise,
    )
    state, outputs = _filter(params, state, usable, still, slice_trace(trace, slice(first, None)))
    track = _to_track(params, state.setup, usable, still, outputs)
    contradicted, track = _extend_doubt(params, state.contradicted, track)
    state = replace(state, recent=recent, contradicted=contradicted)
    return state, track if unknown is None else join_tracks([unknown, track])


def _usable_readings(params: MagnetParams, array: Constellation, readings: Readings) -> _Usable:
    samples = np.concatenate([readings.base, readings.target], axis=1)
    limits = np.tile(np.repeat([params.gyr_range * DEG, params.acc_range * GRAVITY], 3), 2)
    with np.errstate(invalid="ignore"):
        saturated = np.asarray((np.abs(readings.mag) >= 0.999e-6 * params.mag_range).any(axis=2))
    mag = np.where(saturated[..., None], np.nan, readings.mag)
    return _Usable(
        readings.t,
        np.where(np.abs(samples) < 0.999 * limits, samples, np.nan),
        mag,
        quat.rotate(array.q_bl, mag) if len(mag) else mag,
        np.zeros(mag.shape[:2]) if readings.age is None else readings.age,
        saturated,
    )


def _initialise(params: MagnetParams, state: State, usable: _Usable) -> tuple[int, State]:
    """First row to filter, and the state with which the filter starts there, if it has none yet and
    a complete sample comes."""
    n = len(usable.t)
    if state.x is not None:
        return 0, state
    whole = np.isfinite(usable.samples).all(axis=1) & np.isfinite(usable.mag).all(axis=(1, 2))
    if not whole.any():
        return n, replace(state, t=float(usable.t[-1]) if n else state.t)
    first = int(whole.argmax())
    sample, t = usable.samples[first], float(usable.t[first])
    x, P = magnet_initialisation.initial_state(
        params, state.setup, sample, usable.mag[first], usable.mag_b[first]
    )
    return first, replace(state, x=x, covariance=P, newest=sample, t=t)


def _filter(
    params: MagnetParams, state: State, usable: _Usable, still: Bools, trace: Trace | None
) -> tuple[State, FilterOutputs]:
    """The state after the compiled loop over all readings."""
    assert state.x is not None
    n, setup, kinematics = len(usable.t), state.setup, copy_kinematics(state.kinematics)
    outputs = FilterOutputs(
        np.empty((n, len(state.x))),
        np.empty((n, len(state.covariance))),
        np.empty(n),
        trace or make_trace(0, len(state.x)),
    )
    end = run_filter(
        noise_model(params, magnet_initialisation.array_span(setup.array)),
        magnet_initialisation.workspace_centre(setup),
        FilterState(
            state.x.copy(), state.covariance.copy(), state.newest.copy(), kinematics, state.monitor
        ),
        FilterInputs(
            np.diff(usable.t, prepend=state.t),
            np.ascontiguousarray(usable.samples),
            np.ascontiguousarray(usable.mag_b),
            np.ascontiguousarray(usable.age),
            still,
        ),
        outputs,
    )
    state = replace(state, x=end.x, covariance=end.P, newest=end.newest, monitor=end.monitor)
    t = float(usable.t[-1]) if n else state.t
    return replace(state, kinematics=end.kinematics, t=t), outputs


def _extend_doubt(params: MagnetParams, contradicted: float, track: Track) -> tuple[float, Track]:
    """The newest time at which readings contradicted the setup, and the track with all that follows
    such a time doubtful for a while."""
    times = np.concatenate([[contradicted], np.where(track.doubtful, track.t, -np.inf)])
    newest = np.maximum.accumulate(times)
    doubtful = track.t - newest[1:] <= params.doubtful_time
    return float(newest[-1]), replace(track, doubtful=doubtful)


def finish(params: MagnetParams, state: State) -> tuple[State, Track]:
    """Nothing waits; for the interface that every tracker has."""
    nothing = Readings(
        np.empty(0), np.empty((0, 6)), np.empty((0, 6)), np.empty((0, len(state.setup.array), 3))
    )
    return state, _unknown_track(state, nothing, 0, np.empty((0, len(state.setup.array)), bool))


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
    moment, lever = x[rows(STATE.moment)], x[rows(STATE.lever)]
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
    params: MagnetParams, setup: Setup, usable: _Usable, still: Bools, outputs: FilterOutputs
) -> Track:
    """States and standard deviations, larger where declared values had to be moved far."""
    x, sd = outputs.x, np.sqrt(np.maximum(outputs.variance, 0.0))
    sds = magnet_initialisation.declared_sds(params, setup)
    deviations = np.abs(x[:, STATE.moment :] - magnet_initialisation.declared_values(setup)) / sds
    p_value = deviation_p_value(deviations[:, :-1], sd[:, OWN:-1] / sds[:-1])
    sd = sd * np.maximum(1.0, deviations[:, :-1].max(axis=1) / ORDINARY_SD)[:, None]
    return Track(
        t=usable.t,
        p_bt=x[:, rows(STATE.p_bt)],
        v_bt=x[:, rows(STATE.v_bt)],
        q_bt=x[:, rows(STATE.q_bt, 4)],
        q_gb=x[:, rows(STATE.q_gb, 4)],
        field=x[:, rows(STATE.B_g)],
        p_sd=sd[:, rows(ERROR.p_bt)],
        v_sd=sd[:, rows(ERROR.v_bt)],
        q_bt_sd=sd[:, rows(ERROR.th_bt)],
        q_gb_sd=sd[:, rows(ERROR.th_gb)],
        snr=signal_strength(usable.mag, setup.earth),
        latency=x[:, LATENCY],
        latency_sd=sd[:, LATENCY],
        nis=outputs.mean_nis,
        saturated=usable.saturated,
        still=still,
        doubtful=_doubtful(params, setup, outputs, deviations, p_value),
    )


def _doubtful(
    params: MagnetParams, setup: Setup, outputs: FilterOutputs, deviations: Array, p_value: Array
) -> Bools:
    """Whether readings contradict the setup or the room (n,)."""
    strength = np.linalg.norm(outputs.x[:, rows(STATE.B_g)], axis=1)
    is_strange = np.abs(strength / setup.earth - 1.0) > 0.2  # iron or a magnet taken for the field
    return np.asarray(
        (outputs.mean_nis > params.nis_limit)
        | is_strange
        | (deviations.max(axis=1) > params.deviation_limit)
        | (p_value < params.min_p_value)
        | (len(setup.array) < 2)
    )


def join_tracks(pieces: Sequence[Track]) -> Track:
    """One after the other."""
    return Track(*(np.concatenate([getattr(p, f.name) for p in pieces]) for f in fields(Track)))


def select_readings(readings: Readings, rows: slice) -> Readings:
    """Some of the readings."""
    age = None if readings.age is None else readings.age[rows]
    return Readings(
        readings.t[rows], readings.base[rows], readings.target[rows], readings.mag[rows], age
    )


def _unknown_track(state: State, readings: Readings, n: int, saturated: Bools) -> Track:
    """The first n samples, before the filter could start: nothing is known."""
    v, q = np.full((n, 3), np.nan), np.full((n, 4), np.nan)
    silent = np.full((n, len(state.setup.array)), np.nan)
    never = np.zeros((n, 2), bool)
    return Track(
        readings.t[:n],
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
        saturated[:n],
        never,
        np.ones(n, bool),
    )
