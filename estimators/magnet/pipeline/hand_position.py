"""Position of the hand against the trunk from the streams of a recording or a live glove.

In      blocks of trunk, hand and magnetometers; the declared plate; mounting of the sensors
Out     position of the hand's sensor from the trunk's in trunk axes, its standard deviation, flags,
        the trunk's orientation, signal
Source  tracker.py (Kortier, thesis ch. 5); flags: ours
Limits  the position of the hand's sensor, not of a joint; the trunk's axes are as its sensor's
        mounting declares
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.magnet_streams import HAND, find_magnetometers, is_relevant
from handscope.estimators.data.options import option
from handscope.estimators.data.samples import ACC, GYR, MAG, TRUNK, Block, Stream
from handscope.estimators.data.trajectory import PLACE_WORDS, PlaceFlag, Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.magnet.model import setup as magnet_setup
from handscope.estimators.magnet.pipeline import streams as magnet_streams
from handscope.estimators.magnet.pipeline.streams import Waiting
from handscope.estimators.magnet.tracker import smoother as magnet_smoother
from handscope.estimators.magnet.tracker import tracker as magnet_tracker
from handscope.estimators.magnet.tracker.initialisation import Setup
from handscope.estimators.magnet.tracker.options import MagnetParams
from handscope.estimators.magnet.tracker.tracker import Readings, Track
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array

REPORTED_SHARE = 0.001  # share of flagged samples
# s, and standard deviations, from which on latency is reported
REPORTED_LATENCY, REPORTED_LATENCY_SD = 0.01, 4.0
MAX_TIME_DISTANCE = 0.1  # s to the nearest sample of the track
ROWS = ("t", "place", "sd", "flags", "q_trunk", "q_trunk_sd", "signal", "latency", "latency_sd")
UNKNOWN = phrase("magnet.place_not_told")


@dataclass(frozen=True, kw_only=True)
class PlaceParams(MagnetParams):
    """Options of the hand's position; m and s."""

    max_sd: float = option(
        0.05,
        "m",
        "standard deviation of a place in its worst direction from which on the magnet is out of reach",
        "ours",
    )
    patience: float = option(
        0.1, "s", "how long a silent stream is waited for", "as the tracking's", least=0.01
    )


@dataclass(frozen=True)
class Setting:
    """What is needed before the first sample."""

    params: PlaceParams
    setup: Setup
    magnetometers: tuple[str, ...]
    q_BS: Array  # (4,) of the trunk's sensor


@dataclass(frozen=True)
class State:
    """Everything the next step needs."""

    waiting: Waiting
    filter: magnet_tracker.State


@dataclass(frozen=True)
class Places:
    """Positions of the hand and their flags."""

    t: Array  # (n,) s
    place: Array  # (n, 3) m; NaN where there is none
    sd: Array  # (n, 3) m
    flags: NDArray[np.uint8]  # (n,)
    q_trunk: Array  # (n, 4)
    q_trunk_sd: Array  # (n, 3) rad
    signal: Array  # (n,) dB; NaN where no magnetometer was read
    latency: Array  # (n,) s of the magnetometers' readings against the inertial ones
    latency_sd: Array  # (n,) s

    def __len__(self) -> int:
        return len(self.t)


def make_setting(
    params: PlaceParams,
    plate: Plate | None,
    streams: Sequence[Stream],
    mounting: Mapping[str, Array],
) -> Setting | None:
    """Setting of a recording; None where nothing of it is worn. InputError says what is missing or
    cannot be."""
    read_recording = find_magnetometers(streams)
    inertial = {p for s in streams if s.inertial for p in s.sensors}
    if plate is None and not read_recording:
        return None
    if plate is None:
        raise InputError("magnet.setup_missing", unknown=UNKNOWN)
    missing = [
        what
        for what, there in (("the trunk", TRUNK in inertial), ("the hand", HAND in inertial))
        if not there
    ]
    if missing:
        raise InputError("magnet.no_inertial_sensor", unknown=UNKNOWN, segment=missing[0])
    if not read_recording:
        raise InputError("magnet.no_magnetometer_on_trunk", unknown=UNKNOWN)
    undeclared = [name for name in read_recording if name not in plate.places]
    if len(undeclared) == len(read_recording):
        raise InputError(
            "magnet.magnetometer_not_in_setup", unknown=UNKNOWN, undeclared=", ".join(undeclared)
        )
    names = tuple(name for name in read_recording if name not in undeclared)
    q_BS = mounting.get(TRUNK, quat.IDENTITY)
    q_bl = np.array(
        [quat.multiply(quat.conjugate(q_BS), mounting.get(name, quat.IDENTITY)) for name in names]
    )
    try:
        array = magnet_setup.make_constellation(
            np.array([plate.places[name] for name in names]), q_bl
        )
        magnet = magnet_setup.make_magnet(np.array(plate.moment), np.array(plate.place))
        setup = Setup(array, magnet, plate.earth, plate.dip)
        magnet_tracker.start(setup)
    except InputError as problem:
        raise InputError("magnet.position_unknown", unknown=UNKNOWN, problem=str(problem)) from None
    return Setting(_with_full_scales(params, streams), setup, names, q_BS)


def start(s: Setting) -> State:
    """The state before the first sample."""
    return State(Waiting(s.magnetometers, {}), magnet_tracker.start(s.setup))


def step(s: Setting, state: State, blocks: Sequence[Block]) -> tuple[State, Places]:
    """Advance by blocks of any streams, cut anywhere."""
    waiting, readings = magnet_streams.take(state.waiting, blocks, s.params.patience)
    following, track = magnet_tracker.step(s.params, state.filter, readings)
    return State(waiting, following), _to_places(s, track)


def smooth_places(s: Setting, blocks: Sequence[Block]) -> Places:
    """Smoothed positions of a whole recording; InputError where the readings cannot be T."""
    return _to_places(s, smooth_recording(s, blocks)[1])


def smooth_recording(s: Setting, blocks: Sequence[Block]) -> tuple[magnet_tracker.State, Track]:
    """The filter's end and the smoothed track of a whole recording; InputError where the readings
    cannot be T."""
    return magnet_smoother.smooth(
        s.params, magnet_tracker.start(s.setup), read_recording(s, blocks)
    )


def read_recording(s: Setting, blocks: Sequence[Block]) -> Readings:
    """Readings of a whole recording; InputError where they cannot be T."""
    readings = magnet_streams.align_recording(s.magnetometers, blocks, s.params.patience)
    try:
        magnet_setup.require_field(readings.mag)
    except InputError as problem:
        raise InputError("magnet.position_unknown", unknown=UNKNOWN, problem=str(problem)) from None
    return readings


def newest_row(places: Places) -> Places:
    """The last row, with the last known signal."""
    signals = places.signal[np.isfinite(places.signal)]
    last = Places(*(getattr(places, f)[-1:] for f in ROWS))
    return replace(last, signal=signals[-1:]) if len(signals) else last


def add_hand_position(
    params: PlaceParams,
    trajectory: Trajectory,
    blocks: Sequence[Block],
    plate: Plate | None,
    mounting: Mapping[str, Array],
) -> tuple[Trajectory, list[str]]:
    """The trajectory with the hand's position, and messages; unchanged where there is no magnet."""
    try:
        s = make_setting(params, plate, [b.stream for b in blocks], mounting)
        if s is None or not len(trajectory):
            return trajectory, []
        places = smooth_places(s, blocks)
    except InputError as problem:
        return trajectory, [str(problem)]
    return (
        (resample_places(trajectory, places), describe_places(places))
        if len(places)
        else (trajectory, [])
    )


def resample_places(trajectory: Trajectory, places: Places) -> Trajectory:
    """The trajectory with positions at its own instants."""
    flags = places.flags[_nearest(places.t, trajectory.t)]
    is_missing = (
        np.abs(places.t[_nearest(places.t, trajectory.t)] - trajectory.t) > MAX_TIME_DISTANCE
    )
    flags = np.where(is_missing, np.uint8(PlaceFlag.MISSING), flags)
    place, sd, q_sd = (
        _interpolate(places.t, v, trajectory.t)
        for v in (places.place, places.sd, places.q_trunk_sd)
    )
    has_signal = np.isfinite(places.signal)
    signal = (
        np.interp(trajectory.t, places.t[has_signal], places.signal[has_signal])
        if has_signal.any()
        else np.full(len(trajectory), np.nan)
    )
    hidden = is_missing[:, None]
    return replace(
        trajectory,
        place=np.where(hidden, np.nan, place),
        place_sd=np.where(hidden, np.nan, sd),
        place_flags=flags,
        q_trunk=np.where(hidden, np.nan, _nearest_orientations(places, trajectory.t)),
        q_trunk_sd=np.where(hidden, np.nan, q_sd),
        signal=np.where(is_missing, np.nan, signal),
    )


def describe_places(places: Places) -> list[str]:
    """One sentence for each kind of flag, and for magnetometers that are late."""
    shares = {flag: float(((places.flags & flag) != 0).mean()) for flag in PLACE_WORDS}
    return describe_latency(places) + [
        phrase("magnet.place_share", what=words, share=100 * shares[flag])
        for flag, words in PLACE_WORDS.items()
        if shares[flag] >= REPORTED_SHARE
    ]


def describe_latency(places: Places) -> list[str]:
    """A sentence about the magnetometers' latency, as known at the newest row, where it is
    significant."""
    tau, sd = (float(v[-1]) if len(v) else np.nan for v in (places.latency, places.latency_sd))
    if not abs(tau) > max(REPORTED_LATENCY, REPORTED_LATENCY_SD * sd):
        return []
    by, known, doubtful = (
        f"{1e3 * abs(tau):.0f}",
        f"{1e3 * sd:.1f}",
        bool(places.flags[-1] & PlaceFlag.DOUBTFUL),
    )
    if doubtful and tau > 0:
        message = phrase("magnet.late_doubtful", late=by, sd=known)
    elif doubtful:
        message = phrase("magnet.early_doubtful", late=by, sd=known)
    elif tau > 0:
        message = phrase("magnet.late_corrected", late=by, sd=known)
    else:
        message = phrase("magnet.early_corrected", late=by, sd=known)
    return [message]


def _with_full_scales(params: PlaceParams, streams: Sequence[Stream]) -> PlaceParams:
    """The parameters with the full scales that the streams declare: the least where they differ."""
    full_scales: dict[str, list[float]] = {GYR: [], ACC: [], MAG: []}
    for s in streams:
        if is_relevant(s):
            for quantity in full_scales:
                full_scales[quantity] += (
                    [s.full_scale[quantity]] if s.full_scale.get(quantity) else []
                )
    gyr, acc, mag = (min(full_scales[q], default=None) for q in (GYR, ACC, MAG))
    return replace(
        params,
        gyr_range=params.gyr_range if gyr is None else float(np.degrees(gyr)),
        acc_range=params.acc_range if acc is None else acc / GRAVITY,
        mag_range=params.mag_range if mag is None else 1e6 * mag,
    )


def _to_places(s: Setting, track: Track) -> Places:
    n = len(track)
    flags = np.zeros(n, np.uint8)
    with np.errstate(invalid="ignore"):
        lost = ~np.isfinite(track.p_bt).all(axis=1) if n else np.zeros(0, bool)
        far = track.p_sd.max(axis=1, initial=0.0) > s.params.max_sd
    flags[lost] |= np.uint8(PlaceFlag.MISSING)
    flags[far & ~lost] |= np.uint8(PlaceFlag.OUT_OF_REACH)
    flags[track.doubtful & ~lost] |= np.uint8(PlaceFlag.DOUBTFUL)
    flags[track.saturated.any(axis=1)] |= np.uint8(PlaceFlag.SATURATED)
    has_signal = np.isfinite(track.snr)
    loudest = np.where(has_signal, track.snr, -np.inf).max(axis=1, initial=-np.inf)
    rotation = np.abs(quat.matrix(s.q_BS)) if n else np.eye(3)
    return Places(
        track.t,
        quat.rotate(s.q_BS, track.p_bt) if n else track.p_bt,
        np.sqrt(track.p_sd**2 @ (rotation**2).T),
        flags,
        quat.multiply(track.q_gb, quat.conjugate(s.q_BS)) if n else track.q_gb,
        track.q_gb_sd,
        np.where(np.isfinite(loudest), loudest, np.nan),
        track.latency,
        track.latency_sd,
    )


def _nearest(t: Array, at: Array) -> NDArray[np.int_]:
    after = np.clip(np.searchsorted(t, at), 1, max(len(t) - 1, 1))
    return np.asarray(
        np.where(
            at - t[after - 1] < t[np.minimum(after, len(t) - 1)] - at,
            after - 1,
            np.minimum(after, len(t) - 1),
        )
    )


def _interpolate(t: Array, values: Array, at: Array) -> Array:
    return np.stack([np.interp(at, t, v) for v in values.T], axis=1)


def _nearest_orientations(places: Places, at: Array) -> Array:
    """Orientations at the instants: the nearest one."""
    return np.asarray(places.q_trunk[_nearest(places.t, at)])
