"""Sensors checked against each other and against the declared hand, without estimating how the hand moved.

In      samples of all inertial streams, declared hand and geometry, nominal mounting, calibrations where there are any
Out     suspicions, most certain first; none for a recording whose sensors agree
Source  ours; each family of tests has the false-alarm probability `FALSE_ALARM` for a recording (Bonferroni within the family)
Limits  what the movement does not show is not found: the tests stay silent where joints hardly move; see the modules that they call
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import Block, Event, Recording
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.neighbours import (
    delays,
    exchanges,
    gains,
    joint_places,
    joint_windows,
    slips,
    unexplained,
    vibration,
)
from handscope.estimators.fault_detection.neighbours.delays import Delay
from handscope.estimators.fault_detection.neighbours.joint_places import Bone, Verdict
from handscope.estimators.fault_detection.neighbours.other_joints import Others
from handscope.estimators.fault_detection.neighbours.rates import rate_tests, synchrony
from handscope.estimators.fault_detection.neighbours.rates.common_rates import CommonRates
from handscope.estimators.fault_detection.neighbours.rates.synchrony import Signals
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.fault_detection.neighbours.suspicions import (
    of_common_gain,
    of_delay,
    of_exchange,
    of_gain,
    of_slip,
    of_unexplained,
    of_verdict,
    whole_span,
)
from handscope.estimators.fault_detection.neighbours.unexplained import Unexplained
from handscope.estimators.fault_detection.neighbours.vibration import Vibration
from handscope.estimators.fault_detection.single_sensors.cells import (
    Cells,
    cells_of,
    forward_streams,
)
from handscope.estimators.fault_detection.single_sensors.rest_turns import without_bias
from handscope.estimators.hand.anatomy import FINGERS, Hand, side_sign
from handscope.estimators.hand.geometry import HandGeometry, root_joint
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

FALSE_ALARM = 2e-4  # of each family of tests in one recording: nine of them, those of synchrony.py and finger_order.py, and those of single sensors, stay below 1 in 200
# samples by which all gyroscopes may be behind their accelerometers: a reading is the mean rate since the one before, or accelerometers are filtered as much more
BEHIND = (0.5, -0.5)
FEW = 12  # windows by which these are told from readings of one instant ...
LITTLE = 0.1  # ... if joints leave more than about a tenth of the noise
WHOLE_HAND = {"hand.other", "geometry.other_hand"}  # whatever is wrong with a finger
MIRRORED, MOST_WRONG = (
    "hand.mirrored",
    1,
)  # by knuckles, so many of which may be those of fingers in which something is wrong
OF_HAND = 1e-5  # the same of the declared hand: how far people's knuckles lie from the declared is known roughly


def prepare_pairs(
    blocks: Sequence[Block],
    geometry: HandGeometry,
    mounting: Mapping[str, Array],
    calibrations: Sequence[Calibration],
) -> Pairs | None:
    """Pair all sensors, for several checks of one recording; None where there is too little to compare."""
    known = calibrations[0] if calibrations else None
    bias, blocks = known.gyr_bias if known else {}, list(blocks)
    series = joint_windows.common_series(blocks, bias)
    if series is None or series.count < 2 * joint_windows.RATE * joint_windows.LENGTH:
        return None
    mounted = {**mounting, **(known.q_BS if known else {})}
    q_BS = {
        s: quat.normalize(np.asarray(mounted.get(s, quat.IDENTITY), float)) for s in series.sensors
    }
    pairs = Pairs(series, geometry, q_BS)
    left = _misfit(pairs)
    for behind in BEHIND if left > LITTLE else ():
        otherwise = joint_windows.common_series(blocks, bias, behind)
        assert otherwise is not None
        other = Pairs(otherwise, geometry, q_BS)
        if (less := _misfit(other)) < left:
            pairs, left = other, less
    return pairs


def _misfit(pairs: Pairs) -> float:
    """What joints leave in the liveliest windows, mean log ratio to the noise: by it the recording tells how far gyroscopes' readings are behind."""
    few = Pairs(joint_windows.liveliest(pairs.series, FEW), pairs.geometry, pairs.q_BS)
    fits = [few.joint(*j, j) for j in few.joints]
    use = [few.use(*j) & few.turns(*j) for j in few.joints]
    every = [np.log1p((f.rest / f.noise)[u]) for f, u in zip(fits, use)]
    left = np.concatenate([np.zeros(1), *every])
    return float(left.mean())


@dataclass(frozen=True)
class Views:
    """What pairs show in other ways than by the acceleration of their joints, each computed when first asked for, once."""

    pairs: Pairs

    @cached_property
    def rates(self) -> CommonRates:
        """What neighbours' rates have in common."""
        return CommonRates(self.pairs)

    @cached_property
    def others(self) -> Others:
        """How large errors are, by the joints that a sensor is not at."""
        return Others(self.pairs)

    @cached_property
    def vibration(self) -> Vibration:
        """What neighbours vibrate together."""
        return Vibration(self.pairs)

    @cached_property
    def signals(self) -> Signals | None:
        """What bends together."""
        return synchrony.signals_of(self.pairs)


@dataclass(frozen=True)
class Compared:
    """Sensors of one recording as several checks compare them: pairs are computed when first asked for, once."""

    blocks: Sequence[Block]
    declared: Recording
    calibrations: Sequence[Calibration]

    @property
    def cells(self) -> Cells:
        """Readings of every sensor by itself, of streams whose times run forward; not kept, as they are half of what the recording takes."""
        return without_bias(cells_of(forward_streams(whole_streams(self.blocks))))

    @cached_property
    def pairs(self) -> Pairs | None:
        """None where there is too little to compare."""
        declared = self.declared
        return prepare_pairs(self.blocks, declared.geometry, declared.mounting, self.calibrations)

    @cached_property
    def views(self) -> Views | None:
        """None where there are no pairs."""
        return None if self.pairs is None else Views(self.pairs)


def check_neighbours(views: Views, geometry: HandGeometry) -> list[Suspicion]:
    """Check neighbouring sensors against each other: exchanged, late, slipped, or all read at another rate than the file tells; the declared hand itself is asked by `check_hand`.

    Returns
    -------
    list of Suspicion
        With a correction where one answer is left: `exchange` (two segments), `order` (sensor that sits on a segment, by segment), `delay` (s, to be
        subtracted from the sensors' times), `turn` (4,) from `start` (s) on: rotation that takes vectors of the sensor's later frame to its earlier one.
    """
    pairs = views.pairs
    if _behind_the_wrist(geometry):
        return []  # so are its joint positions told by `check_hand`
    if (verdict := _verdict(pairs, geometry)[0]) is not None and verdict.kind == "hand":
        return []  # `check_hand` tells it; every joint lies elsewhere than expected
    gain, p_value = gains.find_common(pairs)
    if p_value < FALSE_ALARM and pairs.with_common_gain(gain).explains:
        return [of_common_gain(gain, p_value, pairs)]
    if not pairs.explains:
        return []
    every = [*unexplained.find(pairs, views.others), *rate_tests.find_unexplained(views.rates)]
    odd = _once([u for u in every if u.p_value < FALSE_ALARM])
    named = _named(views, [u.joint for u in odd])
    return named + [
        of_unexplained(u)
        for u in by_single_sensors(odd)
        if not any(_shares_joint(pairs, u.joint, t.sensors) for t in named)
    ]


def _once(odd: Sequence[Unexplained]) -> list[Unexplained]:
    """Of each joint what is most certain."""
    least = {u.joint: u for u in sorted(odd, key=lambda u: -u.p_value)}
    return list(least.values())


def by_single_sensors(odd: Sequence[Unexplained]) -> list[Unexplained]:
    """Odd joints without those of fingers in which one faulty sensor does not explain all: what strikes a finger shakes all its sensors, and two that fail at once are as rare as two false alarms."""
    shaken = {
        _limb(u.joint[1])
        for u in odd
        for v in odd
        if _limb(u.joint[1]) == _limb(v.joint[1]) and not {*u.joint} & {*v.joint}
    }
    return [u for u in odd if _limb(u.joint[1]) not in shaken or u.p_value < FALSE_ALARM**2]


def _named(views: Views, odd: Sequence[tuple[str, str]]) -> list[Suspicion]:
    """Faults that are named; at joints that are surely odd the most probable cause needs less evidence."""
    pairs, rates, others = views.pairs, views.rates, views.others

    def is_right(delay: Delay) -> bool:
        return not others.refute_delay(delay.sensors, delay.late, delay.span)

    def is_sure(cause: _Cause) -> bool:
        at_odd_joint = any(set(joint) & set(cause.sensors) for joint in odd)
        return cause.suspicion.p_value < (exchanges.OTHERS if at_odd_joint else FALSE_ALARM)

    def cause_of(exchange: exchanges.Exchange) -> _Cause:
        return _Cause(tuple(exchange.order), exchange.gain, of_exchange(exchange, pairs))

    by_joints = [c for e in [exchanges.find(pairs)] if e and is_sure(c := cause_of(e))]
    by_distances = [] if by_joints else [exchanges.find_by_distances(pairs)]
    wrong_gains = [
        g
        for g in (gains.find(pairs), rate_tests.find_gain(rates))
        if g is not None
        and not others.refute_rates(g.sensor, np.eye(3) / g.gain, whole_span(pairs))
    ]
    single = [
        *by_joints,
        *(cause_of(e) for e in by_distances if e),
        *(
            c
            for g in wrong_gains
            if is_sure(c := _Cause((g.sensor,), g.evidence, of_gain(g, pairs)))
        ),
    ]
    late = _late(delays.find(pairs))
    known = [s for c in late if is_sure(c) for s in c.sensors]
    late += _late(filter(is_right, rate_tests.find_delays(rates, known)))
    known = [s for c in late if is_sure(c) for s in c.sensors]
    late += _late(filter(is_right, vibration.find(views.vibration, known)))
    named = _most_probable(pairs, single, [c for c in late if is_sure(c)])
    accused = [s for t in named for s in t.sensors]
    named += [
        of_delay(d)
        for d in synchrony.find(views.signals, accused)
        if d.p_value < synchrony.FALSE_ALARM and is_right(d)
    ]
    slipped = [
        s
        for s in (
            slips.find_jump(pairs),
            slips.find_turning(pairs, others),
            slips.find(pairs),
        )
        if s is not None and s.p_value < FALSE_ALARM
    ][:1]
    return named + [
        of_slip(s, pairs)
        for s in slipped
        if not any(_shares_joint(pairs, (s.sensor,), t.sensors) for t in named)
    ]


@dataclass(frozen=True)
class _Cause:
    """One explanation of what joints leave over."""

    sensors: tuple[str, ...]
    evidence: float  # log ratio of what is left over, all windows and joints
    suspicion: Suspicion


def _late(found: Iterable[Delay]) -> list[_Cause]:
    """Delays as causes."""
    return [_Cause(d.sensors, d.gain, of_delay(d)) for d in found]


def _most_probable(
    pairs: Pairs, single: Sequence[_Cause], several: Sequence[_Cause]
) -> list[Suspicion]:
    """Of causes at one joint those that explain more: one single cause, or all of several together."""
    left, named = list(several), list[_Cause]()
    for cause in sorted(single, key=lambda c: -c.evidence):
        rivals = [c for c in left if _shares_joint(pairs, cause.sensors, c.sensors)]
        taken = any(_shares_joint(pairs, cause.sensors, c.sensors) for c in named)
        if not taken and cause.evidence > sum(c.evidence for c in rivals):
            named.append(cause)
            left = [c for c in left if c not in rivals]
    return [c.suspicion for c in (*named, *left)]


def check(
    blocks: Sequence[Block],
    hand: Hand,
    geometry: HandGeometry,
    mounting: Mapping[str, Array],
    calibrations: Sequence[Calibration],
    events: Sequence[Event],
    compared: Compared | None = None,
) -> list[Suspicion]:
    """Both checks of one recording: `check_neighbours`, then `check_hand` without bones of fingers in which something else is wrong.

    Parameters
    ----------
    blocks : sequence of Block
        Samples of all streams.
    hand, geometry, mounting, calibrations, events
        What is declared and known of the recording.
    compared : Compared, optional
        Of the same recording, where several checks share it.
    """
    pairs = compared.pairs if compared else prepare_pairs(blocks, geometry, mounting, calibrations)
    if pairs is None or _behind_the_wrist(geometry):
        return check_hand(blocks, hand, geometry, mounting, calibrations, events, pairs)
    views = compared.views if compared else None
    suspicions = check_neighbours(views or Views(pairs), geometry)
    wrong = {_limb(s) for t in suspicions for s in t.sensors}
    of_hand = check_hand(blocks, hand, geometry, mounting, calibrations, events, pairs)
    if wrong:  # what is wrong with a finger moves its knuckle, too
        whole = WHOLE_HAND | ({MIRRORED} if len(wrong & {*FINGERS[1:]}) <= MOST_WRONG else set())
        of_hand = [
            t
            for t in of_hand
            if t.message.code in whole or not wrong & {_limb(s) for s in t.sensors}
        ]
    if any(
        t.message.code in WHOLE_HAND | {MIRRORED} for t in of_hand
    ):  # as the thumb's joints lie elsewhere
        suspicions = [t for t in suspicions if {_limb(s) for s in t.sensors} != {"thumb"}]
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

    Parameters are those of `check`.

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
        return [of_verdict(verdict, pairs)]
    odd = [(bone, p) for bone, p in joint_places.odd_lengths(along) if p < FALSE_ALARM]
    return [
        Suspicion(
            Message(
                "person.bone_length",
                {"segment": b.segment, "seen_mm": 1e3 * b.length, "declared_mm": 1e3 * b.declared},
                "info",
            ),
            (b.segment,),
            (whole_span(pairs),),
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
    along, seen = joint_places.bones(pairs, geometry), joint_places.roots(pairs)
    of_hand = joint_places.judge(seen, along, geometry)
    order = joint_places.exchanged_fingers(seen, geometry) if seen else None
    if of_hand is None or of_hand.p_value >= OF_HAND:
        return order, along
    is_order = of_hand.kind == "fingers" and order is not None
    return order if is_order else of_hand, along


def _limb(sensor: str) -> str:
    return sensor.partition("_")[0]


def _shares_joint(pairs: Pairs, some: tuple[str, ...], others: tuple[str, ...]) -> bool:
    return any(_touches(j, some) and _touches(j, others) for j in pairs.joints)


def _touches(joint: tuple[str, str], sensors: tuple[str, ...]) -> bool:
    return joint[0] in sensors or joint[1] in sensors
