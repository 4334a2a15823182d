"""Sensors checked against each other and against the declared hand, without estimating how the hand moved.

In      samples of all inertial streams, declared hand and geometry, nominal mounting, calibrations where there are any
Out     suspicions, most certain first; none for a recording whose sensors agree
Source  ours; each family of tests has the false-alarm probability `FALSE_ALARM` for a recording (Bonferroni within the family)
Limits  what the movement does not show is not found: the tests stay silent where joints hardly move; see the modules that they call
"""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.neighbours import (
    delays,
    exchanges,
    joint_places,
    joint_windows,
    slips,
)
from handscope.estimators.fault_detection.neighbours.delays import Delay
from handscope.estimators.fault_detection.neighbours.exchanges import Exchange
from handscope.estimators.fault_detection.neighbours.joint_places import Bone, Verdict
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.fault_detection.neighbours.slips import Slip
from handscope.estimators.fault_detection.single_sensors.significance import odds_of
from handscope.estimators.hand.anatomy import CHAINS, Hand, side_sign
from handscope.estimators.hand.geometry import HandGeometry, root_joint
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

FALSE_ALARM = 1e-4  # of each family of tests in one recording
SEVERITY: Literal["warning"] = (
    "warning"  # not fault: fewer than 1 false alarm in 200 recordings is not shown
)
OF_HAND = 1e-5  # the same of the declared hand: how far people's knuckles lie from the declared is known roughly


def prepare_pairs(
    blocks: Sequence[Block],
    geometry: HandGeometry,
    mounting: Mapping[str, Array],
    calibrations: Sequence[Calibration],
) -> Pairs | None:
    """Pair all sensors, for several checks of one recording; None where there is too little to compare."""
    known = calibrations[0] if calibrations else None
    series = joint_windows.common_series(blocks, known.gyr_bias if known else {})
    if series is None or len(series.t) < 2 * joint_windows.RATE * joint_windows.LENGTH:
        return None
    mounted = {**mounting, **(known.q_BS if known else {})}
    return Pairs(
        series,
        geometry,
        {
            s: quat.normalize(np.asarray(mounted.get(s, quat.IDENTITY), float))
            for s in series.sensors
        },
    )


def check_neighbours(
    blocks: Sequence[Block],
    hand: Hand,
    geometry: HandGeometry,
    mounting: Mapping[str, Array],
    calibrations: Sequence[Calibration],
    events: Sequence[Event],
    pairs: Pairs | None = None,
) -> list[Suspicion]:
    """Check neighbouring sensors against each other: exchanged, late, slipped.

    Parameters
    ----------
    blocks : sequence of Block
        Samples of all streams.
    hand, geometry, mounting, calibrations, events
        What is declared and known of the recording; the hand itself is asked by `check_hand`.
    pairs : Pairs, optional
        Of `prepare_pairs`, where several checks share it.

    Returns
    -------
    list of Suspicion
        With a correction where one answer is left: `exchange` (two segments), `order` (sensor that sits on a segment, by segment), `delay` (s, to be
        subtracted from the sensors' times), `turn` (4,) from `start` (s) on: rotation that takes vectors of the sensor's later frame to its earlier one.
    """
    pairs = pairs or prepare_pairs(blocks, geometry, mounting, calibrations)
    if pairs is None or not pairs.explains:
        return []
    if _behind_the_wrist(geometry):
        return []  # so are its joint positions told by `check_hand`
    if (verdict := _verdict(pairs, geometry)[0]) is not None and verdict.kind == "hand":
        return []  # `check_hand` tells it; every joint lies elsewhere than expected
    exchange, late = (
        exchanges.find(pairs),
        [d for d in delays.find(pairs) if d.p_value < FALSE_ALARM],
    )
    suspicions: list[Suspicion] = []
    if exchange is not None and exchange.p_value < FALSE_ALARM:
        rivals = [d for d in late if _shares_joint(pairs, tuple(exchange.order), d.sensors)]
        if exchange.gain > sum(d.gain for d in rivals):
            late = [d for d in late if d not in rivals]
            suspicions.append(_exchanged(exchange, pairs))
    suspicions += [_late(d) for d in late]
    slipped = [
        s
        for s in (slips.find_jump(pairs), slips.find(pairs))
        if s is not None and s.p_value < FALSE_ALARM
    ][:1]
    return suspicions + [
        _slipped(s, pairs)
        for s in slipped
        if not any(_shares_joint(pairs, (s.sensor,), t.sensors) for t in suspicions)
    ]


def check(
    blocks: Sequence[Block],
    hand: Hand,
    geometry: HandGeometry,
    mounting: Mapping[str, Array],
    calibrations: Sequence[Calibration],
    events: Sequence[Event],
) -> list[Suspicion]:
    """Both checks of one recording: as `check_neighbours`, then `check_hand` without bones of fingers in which something else is wrong."""
    pairs = prepare_pairs(blocks, geometry, mounting, calibrations)
    if pairs is None or _behind_the_wrist(geometry):
        return check_hand(blocks, hand, geometry, mounting, calibrations, events, pairs)
    suspicions = check_neighbours(blocks, hand, geometry, mounting, calibrations, events, pairs)
    wrong = {_limb(s) for t in suspicions for s in t.sensors}
    of_hand = check_hand(blocks, hand, geometry, mounting, calibrations, events, pairs)
    if wrong:  # what is wrong with a finger moves its knuckle, too
        of_hand = [
            t
            for t in of_hand
            if t.message.code in ("hand.other", "geometry.other_hand")
            or not wrong & {_limb(s) for s in t.sensors}
        ]
    return suspicions + of_hand


def check_hand(
    blocks: Sequence[Block],
    hand: Hand,
    geometry: HandGeometry,
    mounting: Mapping[str, Array],
    calibrations: Sequence[Calibration],
    events: Sequence[Event],
    pairs: Pairs | None = None,
) -> list[Suspicion]:
    """Check the sensors against the declared hand: fingers exchanged, the other hand, its joint positions, bones of another size.

    Parameters are those of `check_neighbours`.

    Returns
    -------
    list of Suspicion
        Bones that do not fit are questions (severity `info`).
    """
    if impossible := _behind_the_wrist(geometry):
        sensors = tuple(
            dict.fromkeys(s for b in blocks if b.stream.inertial for s in b.stream.sensors)
        )
        message = Message("geometry.impossible", {"joints": ", ".join(impossible)}, "fault")
        return [Suspicion(message, sensors, ((-np.inf, np.inf),), 0.0)]
    pairs = pairs or prepare_pairs(blocks, geometry, mounting, calibrations)
    if pairs is None or not pairs.explains:
        return []
    verdict, along = _verdict(pairs, geometry)
    if verdict is not None:
        return [_contradicted(verdict, pairs)]
    odd = [(bone, p) for bone, p in joint_places.odd_lengths(along) if p < FALSE_ALARM]
    return [
        Suspicion(
            Message(
                "person.bone_length",
                {"segment": b.segment, "seen_mm": 1e3 * b.length, "declared_mm": 1e3 * b.declared},
                "info",
            ),
            (b.segment,),
            (_whole(pairs),),
            p,
        )
        for b, p in odd
    ]


def _behind_the_wrist(geometry: HandGeometry) -> list[str]:
    """Knuckles whose declared place is proximal of the wrist on the declared hand: no hand is built so."""
    sign = side_sign(geometry.hand)
    return [
        j
        for j, place in geometry.joint_positions.items()
        if sign * place[1] < 0 and j != root_joint("thumb")
    ]


def _verdict(pairs: Pairs, geometry: HandGeometry) -> tuple[Verdict | None, list[Bone]]:
    along = joint_places.bones(pairs, geometry)
    verdict = joint_places.judge(joint_places.roots(pairs), along, geometry)
    return verdict if verdict is not None and verdict.p_value < OF_HAND else None, along


def _limb(sensor: str) -> str:
    return sensor.partition("_")[0]


def _shares_joint(pairs: Pairs, some: tuple[str, ...], others: tuple[str, ...]) -> bool:
    return any(_touches(j, some) and _touches(j, others) for j in pairs.joints)


def _touches(joint: tuple[str, str], sensors: tuple[str, ...]) -> bool:
    return joint[0] in sensors or joint[1] in sensors


def _whole(pairs: Pairs) -> tuple[float, float]:
    return float(pairs.series.t[0]), float(pairs.series.t[-1])


def _exchanged(found: Exchange, pairs: Pairs) -> Suspicion:
    sensors = tuple(found.order)
    two = len(sensors) == 2
    correction = (
        {"exchange": sensors}
        if two and found.is_only
        else {"order": dict(found.order)}
        if found.is_only
        else None
    )
    values: dict[str, float | str] = {
        "first": sensors[0],
        "second": sensors[1],
        "sensors": ", ".join(sensors),
        "odds": odds_of(found.p_value),
    }
    code = "sensors.exchanged" if two else "sensors.order"
    return Suspicion(
        Message(code, values, SEVERITY), sensors, (_whole(pairs),), found.p_value, correction
    )


def _late(found: Delay) -> Suspicion:
    code = "sensors.late" if found.late > 0 else "sensors.early"
    values: dict[str, float | str] = {
        "sensors": ", ".join(found.sensors),
        "delay_ms": abs(1e3 * found.late),
        "start": found.span[0],
        "stop": found.span[1],
        "odds": odds_of(found.p_value),
    }
    return Suspicion(
        Message(code, values, SEVERITY),
        found.sensors,
        (found.span,),
        found.p_value,
        {"delay": found.late},
    )


def _slipped(found: Slip, pairs: Pairs) -> Suspicion:
    turn = float(np.degrees(np.linalg.norm(found.turn)))
    values: dict[str, float | str] = {
        "sensor": found.sensor,
        "angle_deg": turn,
        "start": found.start,
        "odds": odds_of(found.p_value),
    }
    span = (found.start, float(pairs.series.t[-1]))
    correction = {"turn": quat.exp(found.turn), "start": found.start}
    return Suspicion(
        Message("sensor.slipped", values, SEVERITY),
        (found.sensor,),
        (span,),
        found.p_value,
        correction,
    )


def _contradicted(verdict: Verdict, pairs: Pairs) -> Suspicion:
    every, span = pairs.series.sensors, (_whole(pairs),)
    if verdict.kind == "fingers":
        a, b = verdict.fingers
        sensors = tuple(s for f in verdict.fingers for s in CHAINS[f] if s in every)
        message = Message(
            "fingers.exchanged",
            {"first": a, "second": b, "odds": odds_of(verdict.p_value)},
            SEVERITY,
        )
        exchange = tuple((s, t) for s, t in zip(CHAINS[a], CHAINS[b]))
        return Suspicion(
            message,
            sensors,
            span,
            verdict.p_value,
            {"exchange": exchange} if verdict.is_only else None,
        )
    code = {"hand": "hand.other", "side": "hand.mirrored", "positions": "geometry.other_hand"}[
        verdict.kind
    ]
    return Suspicion(
        Message(code, {"odds": odds_of(verdict.p_value)}, SEVERITY), every, span, verdict.p_value
    )
