"""Checks while a session runs: when they begin, what they may cost, what they offer; and what is accepted of it."""

import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from handscope.app.live import sensor_checks
from handscope.app.live.live_corrections import LiveCorrections
from handscope.app.live.sensor_checks import MOVED, SHARE, USUAL_COST, SensorChecks
from handscope.app.live.wizard.machine import State, StationStatus, Wizard
from handscope.estimators.data.samples import ACC, GYR, Block, Event, Stream
from handscope.estimators.fault_detection.check import check_recording
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.hand.geometry import sized
from tests.simulated import in_strips

SIGN = Suspicion(
    Message("sensor.gyroscope_sign", {"sensor": "index_middle", "axis": "z"}, "fault"),
    ("index_middle",),
    ((0.0, 10.0),),
    1e-9,
    {"gyr": np.diag([1.0, 1.0, -1.0])},
)
STRIPS = Suspicion(
    Message("fingers.exchanged", {"first": "index", "second": "ring"}, "fault"),
    (*CHAINS["index"], *CHAINS["ring"]),
    ((0.0, 10.0),),
    1e-9,
    {"exchange": tuple(zip(CHAINS["index"], CHAINS["ring"]))},
)
QUESTION = Suspicion(Message("person.bone_length", {}, "info"), ("index_middle",), (), 0.0)


@dataclass
class Session:
    """A session as the checks see it: what is found is set by the test."""

    found: list[Suspicion] = field(default_factory=list)
    looked: list[Mapping[str, Any]] = field(default_factory=list)  # arguments of every check
    told: int = 0
    fails: bool = False

    def __post_init__(self) -> None:
        self.tracking = SimpleNamespace(
            samples=lambda since: [], newest_sample=lambda: 40.0, calibration=None, spent=0.0
        )
        geometry = sized("left")
        self.checks = SensorChecks(
            cast(Any, self.tracking), "left", geometry, self.notify, nullcontext()
        )
        self.wizard, self.t = Wizard((), 3.0), 0.0

    def notify(self) -> None:
        self.told += 1

    def check(self, blocks: Sequence[Block], *declared: Any) -> tuple[list[Suspicion], float]:
        self.looked.append({"blocks": blocks})
        if self.fails:
            raise ZeroDivisionError
        return self.found, 0.0

    def go_on(self, state: State, seconds: float, moving: bool = True) -> None:
        """Ticks of half a second, with the check that one begins done before the next."""
        for _ in range(round(2 * seconds)):
            self.t += 0.5
            rate = 1.0 if moving else 0.0
            status = SimpleNamespace(t=self.t, flowing=True, angular_rate_peak=rate)
            self.wizard = replace(self.wizard, state=state)
            self.wizard = self.checks.follow(self.wizard, cast(StationStatus, status), {})
            if self.checks._thread:
                self.checks._thread.join()


@pytest.fixture
def session(monkeypatch: pytest.MonkeyPatch) -> Session:
    one = Session()
    monkeypatch.setattr(sensor_checks, "find_beside", one.check)
    return one


def test_the_first_check_waits_for_movement_and_the_next_for_twice_as_much(
    session: Session,
) -> None:
    session.go_on(State.CONNECT, 3 * MOVED, moving=False)
    session.go_on(State.CONNECT, MOVED - 1)
    assert session.looked == []
    session.go_on(State.CONNECT, 2)
    assert len(session.looked) == session.told == 1
    session.go_on(State.CONNECT, MOVED - 2)
    assert len(session.looked) == 1
    session.go_on(State.CONNECT, 2)
    assert len(session.looked) == 2


def test_a_wrong_sign_is_offered_in_the_first_step_and_questions_about_the_person_are_not(
    session: Session,
) -> None:
    session.found = [QUESTION, SIGN]
    session.go_on(State.CONNECT, MOVED + 1)
    assert session.checks.found == (SIGN,)
    assert session.wizard.mend == "gyroscope index_middle 1 0 0 0 1 0 0 0 -1"
    session.go_on(State.POSE_READY, 1)
    assert session.checks.found == (SIGN,)  # still said


def test_strips_on_each_others_finger_are_offered_as_an_exchange_of_strips(
    session: Session,
) -> None:
    session.found = [STRIPS]
    session.go_on(State.CONNECT, MOVED + 1)
    assert session.wizard.swapped == ("index", "ring") and session.wizard.mend == ""


def test_after_the_first_step_a_check_runs_once_a_pose_or_task_and_only_if_it_is_paid_for(
    session: Session,
) -> None:
    session.checks._cost, session.tracking.spent = 1.0, 0.5 / SHARE
    session.go_on(State.POSE_REVIEW, 1)
    assert session.looked == []
    session.tracking.spent = 1.5 / SHARE  # the tracker went on meanwhile
    session.go_on(State.POSE_REVIEW, 1)
    session.go_on(State.TASKS, 5)
    assert len(session.looked) == 1
    session.go_on(State.TASK_REVIEW, 5)
    assert len(session.looked) == 2
    assert session.checks.spent <= SHARE * session.tracking.spent


def test_a_check_that_is_the_first_of_all_is_paid_for_like_any_other(session: Session) -> None:
    session.go_on(State.POSE_REVIEW, 1)
    assert session.looked == []
    session.tracking.spent = 1.1 * USUAL_COST / SHARE
    session.go_on(State.TASKS, 1)
    assert len(session.looked) == 1


def test_what_was_found_stays_until_it_is_found_anew_or_read_in_another_manner(
    session: Session,
) -> None:
    session.found = [SIGN]
    session.go_on(State.CONNECT, MOVED + 1)
    session.found, session.tracking.spent = [STRIPS], 1e6
    session.go_on(State.TASK_REVIEW, 1)
    assert session.checks.found == (SIGN, STRIPS)
    session.checks.restart()
    assert session.checks.found == ()


def test_what_a_check_finds_in_samples_read_otherwise_since_is_dropped(session: Session) -> None:
    session.found = [SIGN]
    begun = session.checks._begun
    session.checks.restart()
    session.checks._run(True, {}, begun)
    assert session.checks.found == () and session.told == 0


def test_a_check_that_fails_ends_no_session(session: Session) -> None:
    session.fails = True
    session.go_on(State.CONNECT, MOVED + 1)
    assert len(session.looked) == 1 and session.checks.found == ()


class Glove:
    """Keeps events, as a glove's recording does."""

    def __init__(self) -> None:
        self.events: dict[str, Event | None] = {}

    def keep_event(self, name: str, event: Event | None) -> None:
        self.events[name] = event


def test_a_correction_is_kept_as_an_event_and_changes_what_is_read_not_what_came() -> None:
    glove, corrections = Glove(), LiveCorrections(iter(range(9)).__next__)
    came = Block(
        Stream("index", CHAINS["index"], (GYR, ACC), 100.0), np.zeros(1), np.ones((1, 3, 6))
    )
    corrections.add("gyroscope index_middle 1 0 0 0 1 0 0 0 -1", -0.2, cast(Any, glove))
    (read,) = corrections.read([came])
    assert read.values[0, 1].tolist() == [1, 1, -1, 1, 1, 1]
    assert (came.values == 1).all()
    assert glove.events == {
        "correction-0": Event(
            0.0, 0.0, "correction", {"correction": "gyroscope index_middle 1 0 0 0 1 0 0 0 -1"}
        )
    }
    corrections.add("exchange index_middle index_distal", 3.0, cast(Any, glove))
    (read,) = corrections.read([came])
    assert read.stream.sensors == ("index_proximal", "index_distal", "index_middle")
    corrections.withdraw(cast(Any, glove))
    assert set(glove.events.values()) == {None}
    (read,) = corrections.read([came])
    np.testing.assert_array_equal(read.values, came.values)


def test_after_a_task_the_part_in_which_the_sensors_turned_most_is_looked_at(
    session: Session,
) -> None:
    stream = Stream("imu", ("hand", "index_middle"), (GYR, ACC), 100.0, "imu")
    t = 10.0 + np.arange(3000) / 100.0
    values = np.zeros((len(t), 2, 6))
    values[(t >= 18.0) & (t < 31.0), 1, 2] = 3.0
    session.tracking.samples = lambda since: [Block(stream, t, values).between(since, np.inf)]
    session.tracking.spent = 1e3
    session.go_on(State.TASK_REVIEW, 1)
    (block,) = session.looked[0]["blocks"]
    assert block.t[0] <= 18.0 and block.t[-1] >= 30.9
    assert block.t[-1] - block.t[0] == pytest.approx(sensor_checks.BUSIEST, abs=0.02)


def test_samples_that_a_check_has_seen_are_not_looked_at_again(session: Session) -> None:
    stream = Stream("imu", ("hand", "index_middle"), (GYR, ACC), 100.0, "imu")
    t = 36.0 + np.arange(1000) / 100.0
    block = Block(stream, t, np.ones((len(t), 2, 6)))
    session.tracking.samples = lambda since: [block.between(since, np.inf)]
    session.tracking.spent = 1e3
    session.go_on(State.TASK_REVIEW, 1)
    session.tracking.newest_sample = lambda: 46.0
    session.go_on(State.TASKS, 1)
    session.go_on(State.TASK_REVIEW, 1)
    (again,) = session.looked[1]["blocks"]
    assert again.t[0] >= 40.0


def test_a_check_computes_in_a_process_of_its_own_and_says_what_that_cost() -> None:
    recording = in_strips("left")
    blocks = [b.between(0.0, 5.0) for b in recording.samples.values()]
    began = time.process_time()
    found, cost = sensor_checks.find_beside(blocks, None, ())
    assert [s.message.code for s in found] == [s.message.code for s in check_recording(blocks)]
    assert cost > 0.0 and time.process_time() - began < cost + 0.2
