"""What the checks of sensors against each other found, as suspicions: message, sensors, span, and the correction where one answer is left.

In      findings of the files beside
Out     suspicions
"""

from typing import Literal

import numpy as np

from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.neighbours.delays import Delay
from handscope.estimators.fault_detection.neighbours.exchanges import Exchange
from handscope.estimators.fault_detection.neighbours.gains import Gain
from handscope.estimators.fault_detection.neighbours.joint_places import Verdict
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.fault_detection.neighbours.slips import Slip
from handscope.estimators.fault_detection.neighbours.unexplained import Unexplained
from handscope.estimators.fault_detection.single_sensors.significance import odds_of
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.numerics import quaternions as quat

SEVERITY: Literal["warning"] = (
    "warning"  # not fault: fewer than 1 false alarm in 200 recordings is not shown
)


def whole_span(pairs: Pairs) -> tuple[float, float]:
    """Beginning and end (s) of what was compared."""
    return pairs.series.span


def of_common_gain(gain: float, p_value: float, pairs: Pairs) -> Suspicion:
    """A rate that the file tells wrong, or all gyroscopes that turn too much or too little."""
    values: dict[str, float | str] = {
        "factor": 1.0 / gain,
        "percent": 100.0 * (gain - 1.0),
        "odds": odds_of(p_value),
    }
    message, span = Message("file.rate", values, "fault"), whole_span(pairs)
    return Suspicion(message, pairs.series.sensors, (span,), p_value, {"rate": gain})


def of_exchange(found: Exchange, pairs: Pairs) -> Suspicion:
    """Sensors on each other's segments."""
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
        Message(code, values, SEVERITY), sensors, (whole_span(pairs),), found.p_value, correction
    )


def of_delay(found: Delay) -> Suspicion:
    """Samples that come late or early."""
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


def of_gain(found: Gain, pairs: Pairs) -> Suspicion:
    """A gyroscope that reads too much or too little."""
    values: dict[str, float | str] = {
        "sensor": found.sensor,
        "gain": found.gain,
        "odds": odds_of(found.p_value),
    }
    return Suspicion(
        Message("sensor.gain_at_joints", values, SEVERITY),
        (found.sensor,),
        (whole_span(pairs),),
        found.p_value,
        {"gyr": np.eye(3) / found.gain},
    )


def of_unexplained(found: Unexplained) -> Suspicion:
    """A joint whose sensors do not meet, for no cause that is known."""
    values: dict[str, float | str] = {
        "first": found.joint[0],
        "second": found.joint[1],
        "ratio": float(np.sqrt(found.ratio)),  # of accelerations, or rates, not of their squares
        "start": found.span[0],
        "stop": found.span[1],
        "odds": odds_of(found.p_value),
    }
    return Suspicion(
        Message("sensors.disagree", values, SEVERITY), found.joint, (found.doubtful,), found.p_value
    )


def of_slip(found: Slip, pairs: Pairs) -> Suspicion:
    """A sensor that was turned on its segment."""
    turn = float(np.degrees(np.linalg.norm(found.turn)))
    values: dict[str, float | str] = {
        "sensor": found.sensor,
        "angle_deg": turn,
        "start": found.start,
        "odds": odds_of(found.p_value),
    }
    span = (found.start, pairs.series.span[1])
    correction = None if found.is_seen else {"turn": quat.exp(found.turn), "start": found.start}
    return Suspicion(
        Message("sensor.slipped", values, SEVERITY),
        (found.sensor,),
        (span,),
        found.p_value,
        correction,
    )


def of_verdict(verdict: Verdict, pairs: Pairs) -> Suspicion:
    """What the knuckles' places say of the declared hand."""
    every, span = pairs.series.sensors, (whole_span(pairs),)
    if verdict.kind == "fingers":
        sensors = tuple(s for f in verdict.fingers for s in CHAINS[f] if s in every)
        if len(verdict.fingers) > 2:
            several = Message(
                "fingers.several_exchanged",
                {"fingers": ", ".join(verdict.fingers), "odds": odds_of(verdict.p_value)},
                SEVERITY,
            )
            return Suspicion(several, sensors, span, verdict.p_value)
        a, b = verdict.fingers
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
