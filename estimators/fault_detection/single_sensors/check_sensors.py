"""All that single sensors, and the file, have wrong by their readings alone: public entry to the checks of each sensor against itself.

In      blocks of a recording, or of what has come so far
Out     suspicions: what, which sensors, from when to when, how probable such evidence is without the fault
Source  the files beside
Limits  those of the files beside; sensors against each other are another matter
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import Block
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.single_sensors.accelerometer_check import (
    accelerometer_sizes,
)
from handscope.estimators.fault_detection.single_sensors.cells import (
    CELL,
    CHAIN,
    Cells,
    begins,
    cells_of,
    forward_streams,
)
from handscope.estimators.fault_detection.single_sensors.common_fault import (
    LEAST,
    CommonRate,
    beyond_the_others,
    common_rate,
    shared_fault,
)
from handscope.estimators.fault_detection.single_sensors.frozen_rows import (
    backward_times,
    frozen_stretches,
    repeated_sensors,
)
from handscope.estimators.fault_detection.single_sensors.gravity_fit import likelihoods_of
from handscope.estimators.fault_detection.single_sensors.gyroscope_check import (
    HOPEFUL,
    Judged,
    Verdict,
    judge,
    log_odds,
)
from handscope.estimators.fault_detection.single_sensors.gyroscope_faults import (
    SHARES,
    Fault,
    discrete_faults,
)
from handscope.estimators.fault_detection.single_sensors.lost_rows import lost_rows
from handscope.estimators.fault_detection.single_sensors.magnetometer_check import (
    judge_magnetometers,
)
from handscope.estimators.fault_detection.single_sensors.rest_turns import (
    RestTurn,
    explain,
    find,
    without_bias,
)
from handscope.estimators.fault_detection.single_sensors.significance import FALSE_ALARMS, odds_of
from handscope.estimators.fault_detection.single_sensors.sudden_turns import spikes, sudden_turns
from handscope.estimators.numerics.typing import Array

RATE_OFF = 0.03  # of a rate that is told wrong, at least
NEAR = 0.1  # s
MOST = 2 / 3  # of what is known of a rate, in sensors that agree
OF_AXES = (
    "gyroscope_sign",
    "gyroscope_negated",
    "gyroscope_exchange",
    "gyroscope_axes",
    "accelerometer_sign",
    "accelerometer_exchange",
)
UNCLEAR = "gyroscope_unclear"
CODES = (  # of all messages
    *("file.time_runs_back", "file.frozen", "file.lost_rows", "file.rate"),
    *(
        "file.accelerometer_unit",
        "file.accelerometer_negated",
        "sensor.accelerometer_negated",
        "sensor.accelerometer_size",
        "sensor.accelerometer_unit",
    ),
    *(f"file.{code}" for code in sorted({f.code for f in discrete_faults() if f.code})),
    *(f"sensor.{code}" for code in SHARES),
    "sensor.gyroscope_gain_somewhere",
    f"sensor.{UNCLEAR}",
    "sensor.gyroscope_rests",
    *("sensor.frozen", "sensor.spike"),
    "sensors.identical",
    "sensor.magnetometer_axes",
)
DIFFERENT = 0.3  # of an element of the matrix, times how much that axis turned among the three, from which on corrections are not the same
SMALL = 0.15  # of a gain that is a warning only
CLEAR = 0.6  # probability of a cause from which on it is named
AXIS_GAIN, OF_ALL = "gyroscope_axis_gain", ("gyroscope_gain", ())


def check_sensors(blocks: Sequence[Block], cells: Cells | None = None) -> list[Suspicion]:
    """What is probably wrong with sensors or with the file.

    Parameters
    ----------
    blocks : sequence of Block
        Samples of all streams, in order a stream.
    cells : Cells, optional
        Of these samples, without biases, where other checks share them.

    Returns
    -------
    list of Suspicion
        Faults of the file first. Empty of a recording without faults in all but FALSE_ALARMS of them.
    """
    whole = whole_streams(blocks)
    backward = backward_times(whole)
    whole = forward_streams(whole)
    cells = without_bias(cells_of(whole)) if cells is None else cells
    frozen = frozen_stretches(whole)
    lost = [s for s in lost_rows(whole) if not _beside(s, frozen)]
    stood = [*frozen, *lost]
    seen = [s for s in spikes(whole) if not _beside(s, stood)]
    slipped = [s for s in sudden_turns(whole) if not _beside(s, [*stood, *seen])]
    cells = _without(cells, [*stood, *map(_at_its_start, [*seen, *slipped])])
    sizes, factor = accelerometer_sizes(cells)
    cells = replace(cells, acc=cells.acc * factor)
    gyroscopes = check_gyroscopes(cells)
    gyroscopes = _shared([*gyroscopes, *_between_rests(cells, gyroscopes)], cells)
    found = [
        *backward,
        *frozen,
        *lost,
        *repeated_sensors(whole),
        *seen,
        *sizes,
        *gyroscopes,
        *_magnetometers(cells, whole, gyroscopes),
    ]
    named = {sensor for s in found for sensor in s.sensors}
    found += [s for s in slipped if not named & {*s.sensors}]
    return [
        replace(
            s, message=replace(s.message, values={**s.message.values, "odds": odds_of(s.p_value)})
        )
        for s in found
    ]


def _beside(later: Suspicion, known: Sequence[Suspicion]) -> bool:
    """Whether something seems to begin only because readings stood still, or are lost, before or behind."""
    at = later.spans[0][0]
    return any(a - NEAR < at < b + NEAR for s in known for a, b in s.spans)


def _at_its_start(suspicion: Suspicion) -> Suspicion:
    at = suspicion.spans[0][0]
    return replace(suspicion, spans=((at, at),))


def _without(cells: Cells, suspicions: Sequence[Suspicion]) -> Cells:
    """Cells whose gyroscopes are not carried along over what is frozen or lost."""
    valid = cells.valid.copy()
    for s in suspicions:
        columns = [k for k, name in enumerate(cells.sensors) if name in s.sensors]
        for a, b in s.spans:
            first, last = (int((t - cells.start) / CELL) for t in (a, b))
            valid[max(first, 0) : last + 1, columns] = False
    return replace(cells, valid=valid)


def _magnetometers(
    cells: Cells, blocks: Sequence[Block], gyroscopes: Sequence[Suspicion]
) -> Iterator[Suspicion]:
    """Magnetometers with axes that are not the gyroscope's, of sensors whose gyroscope is right."""
    wrong = {sensor for s in gyroscopes for sensor in s.sensors}
    sensors, judged = judge_magnetometers(cells, blocks)
    for sensor, j in zip(sensors, judged):
        if (
            sensor not in wrong
            and j.verdicts
            and j.named.fault.code in OF_AXES
            and (p := _p_value(j.surest, len(judged))) < FALSE_ALARMS
        ):
            message = Message("sensor.magnetometer_axes", {"sensor": sensor}, "fault")
            yield Suspicion(message, (sensor,), (_span(cells, j.named),), p)


def check_gyroscopes(cells: Cells, among: int = 1) -> list[Suspicion]:
    """What gravity shows of the gyroscopes, in SI units of the accelerometers.

    Parameters
    ----------
    cells : Cells
        Readings of S sensors.
    among : int
        Of how many sensors these are taken, where they are not all: chance has as many chances.

    Returns
    -------
    list of Suspicion
        Of the file first, then by sensor what is wrong beside it.
    """
    judged = judge(cells)
    found = _of_all(cells, judged)
    if found is None:
        return list(_of_sensors(cells, beyond_the_others(judged), max(among, len(judged))))
    suspicion, M = found
    mended = replace(cells, gyr=cells.gyr @ M.T)
    return [suspicion, *_of_sensors(mended, beyond_the_others(judge(mended)), len(judged))]


def _shared(found: Sequence[Suspicion], cells: Cells) -> list[Suspicion]:
    """A fault that several sensors of more than one strip have and that no other contradicts, said once of all: the program that wrote the file does so."""
    best: tuple[list[Suspicion], Fault] | None = None
    for fault in discrete_faults()[1:]:
        have = [s for s in found if s.message.code == f"sensor.{fault.code}"]
        have = [
            s
            for s in have
            if {**s.message.values, "sensor": ""} == {**dict(fault.values), "sensor": ""}
        ]
        strips = {s.sensors[0].partition("_")[0] for s in have}
        if len(have) >= LEAST and len(strips) > 1 and (best is None or len(have) > len(best[0])):
            best = have, fault
    if best is None or _contradicts(cells, *best):
        return list(found)
    have, fault = best
    p = min(s.p_value for s in have)
    others = [s for s in found if s not in have and s.message.code != f"sensor.{UNCLEAR}"]
    code = f"file.{fault.code}"
    return [_suspicion(code, fault, cells.sensors, _whole(cells), p, fault.certain), *others]


def _contradicts(cells: Cells, have: Sequence[Suspicion], fault: Fault) -> bool:
    """Whether sensors that turn enough to show a fault do not have it: one to two that have it are enough."""
    named = {s.sensors[0] for s in have}
    others = cells.of(np.array([k for k, n in enumerate(cells.sensors) if n not in named], int))
    if not others.sensors:
        return False
    as_it_is, with_it = likelihoods_of(others, np.array([np.eye(3), fault.matrix])).sum(axis=1)
    return bool(2 * np.count_nonzero(as_it_is - with_it > HOPEFUL) > len(have))


def _between_rests(cells: Cells, known: Sequence[Suspicion]) -> list[Suspicion]:
    """What rests show of gyroscopes of which nothing is said yet: each with the fault that explains it, or all that have no name together."""
    if any(s.message.code.startswith("file.") for s in known):
        return []
    named = {sensor for s in known for sensor in s.sensors}
    asked = np.array([s not in named for s in cells.sensors])
    turns = [t for t in find(cells, asked) if t.p_value < FALSE_ALARMS]
    faults = [explain(cells, t) for t in turns]
    found = [
        _suspicion(
            f"sensor.{fault.code}",
            fault,
            (cells.sensors[turn.sensor],),
            _since(cells, turn),
            turn.p_value,
            fault.certain,
        )
        for turn, fault in zip(turns, faults)
        if fault is not None
    ]
    without = [t for t, fault in zip(turns, faults) if fault is None]
    return [*found, *([_unnamed(cells, without)] if without else [])]


def _unnamed(cells: Cells, turns: Sequence[RestTurn]) -> Suspicion:
    worst = min(turns, key=lambda t: t.p_value)
    sensors = tuple(cells.sensors[t.sensor] for t in turns)
    values: dict[str, float | str] = {
        "sensor": ", ".join(sensors),
        "off_deg": float(np.degrees(worst.off)),
        "start": worst.rests[0],
        "stop": worst.rests[1],
    }
    message = Message("sensor.gyroscope_rests", values, "fault")
    return Suspicion(message, sensors, (_since(cells, worst),), worst.p_value)


def _since(cells: Cells, turn: RestTurn) -> tuple[float, float]:
    start, stop = _whole(cells)
    return max(start, turn.since), stop


def _of_all(cells: Cells, judged: Sequence[Judged]) -> tuple[Suspicion, Array] | None:
    """A fault that the sensors share, and the matrix that takes it away."""
    p_values = [_p_value(j.surest, len(judged)) if j.verdicts else 1.0 for j in judged]
    surely = [p < FALSE_ALARMS for p in p_values]
    fault = shared_fault(judged, surely)
    if fault is not None:
        span, p = _whole(cells), min(p_values)
        return _suspicion(
            f"file.{fault.code}", fault, cells.sensors, span, p, fault.certain
        ), fault.matrix
    tops = [j.named.fault for j, sure in zip(judged, surely) if sure]
    gains = [fault.matrix[0, 0] for fault in tops if fault.code == "gyroscope_gain"]
    rate = common_rate(cells, float(np.median(gains)) if len(gains) >= LEAST else 1.0)
    return (
        None
        if rate is None or not _sure(rate)
        else (_of_rate(cells, rate), rate.factor * np.eye(3))
    )


def _sure(rate: CommonRate) -> bool:
    off = abs(rate.factor - 1.0) > RATE_OFF
    return rate.p_value < FALSE_ALARMS and off and rate.agreeing > MOST


def _of_rate(cells: Cells, rate: CommonRate) -> Suspicion:
    values = {"factor": rate.factor, "percent": 100 * (1 / rate.factor - 1)}
    message, correction = Message("file.rate", values, "fault"), {"rate": 1 / rate.factor}
    return Suspicion(message, cells.sensors, (_whole(cells),), rate.p_value, correction)


def _of_sensors(cells: Cells, judged: Sequence[Judged], among: int) -> Iterator[Suspicion]:
    """Faults of single sensors that are sure enough."""
    for k, (sensor, j) in enumerate(zip(cells.sensors, judged)):
        if j.verdicts and (p := _p_value(j.surest, among)) < FALSE_ALARMS:
            fault = j.named.fault
            turned = np.sqrt((cells.gyr[cells.valid[:, k], k] ** 2).mean(axis=0))
            differences = [
                (np.abs(v.fault.matrix - fault.matrix) * turned / turned.max()).max()
                for v in j.rivals
            ]
            certain = fault.certain and max(differences) <= DIFFERENT
            described = _clear_fault(j)
            span, certain = _span(cells, j.named), certain and described.certain
            yield _suspicion(f"sensor.{described.code}", described, (sensor,), span, p, certain)


def _clear_fault(judged: Judged) -> Fault:
    """The named fault where its cause is clear; else what the causes have in common."""
    fault, causes = judged.named.fault, judged.causes
    if causes[fault.cause] >= CLEAR:
        return fault
    gains = {v.fault.cause: v.fault for v in sorted(judged.verdicts, key=log_odds)}
    along = max((c for c in causes if c[0] == AXIS_GAIN), key=lambda c: causes[c], default=None)
    if along and causes.get(OF_ALL, 0.0) + causes[along] >= CLEAR and OF_ALL in gains:
        both = tuple(dict(gains[cause].values)["gain"] for cause in (OF_ALL, along))
        values = (*along[1], ("gain", both[0]), ("axis_gain", both[1]))
        return replace(fault, code="gyroscope_gain_somewhere", values=values)
    return Fault(UNCLEAR, (), fault.matrix, certain=False)


def _suspicion(
    code: str,
    fault: Fault,
    sensors: tuple[str, ...],
    span: tuple[float, float],
    p: float,
    certain: bool,
) -> Suspicion:
    values = dict(fault.values) | ({"sensor": sensors[0]} if code.startswith("sensor.") else {})
    late = fault.code == "gyroscope_delay"
    correction = {"delay": values["delay"]} if late else {"gyr": fault.matrix}
    small = (
        late or fault.code == "gyroscope_matrix" or np.abs(fault.matrix - np.eye(3)).max() < SMALL
    )
    message = Message(code, values, "warning" if small else "fault")
    return Suspicion(
        message,
        sensors,
        (span,),
        p,
        correction if certain else None,
        None if late else fault.matrix,
    )


def _p_value(verdict: Verdict, sensors: int) -> float:
    """Probability of such evidence anywhere without a fault: Bonferroni over sensors, faults and stretches."""
    return float(min(1.0, sensors / verdict.weight * np.exp(-verdict.evidence)))


def _whole(cells: Cells) -> tuple[float, float]:
    return cells.start, cells.start + CELL * len(cells.valid)


def _span(cells: Cells, verdict: Verdict) -> tuple[float, float]:
    """When a verdict holds, s; up to the ends of the recording where it reaches the first or last chain."""
    first, (a, b), (start, stop) = begins(len(cells.valid)), verdict.chains, _whole(cells)
    return (
        start if a == 0 else start + CELL * first[a],
        stop if b == len(first) else start + CELL * (first[b - 1] + CHAIN),
    )
