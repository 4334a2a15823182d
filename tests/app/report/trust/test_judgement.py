"""Can I trust these numbers: the answer follows from written rules."""

from dataclasses import asdict, replace

import pytest

from handscope.app.language import languages
from handscope.app.protocols import load_all
from handscope.app.report.trust.judgement import judge_trust, trust_payload, trust_sentences
from handscope.app.report.trust.leading_findings import (
    bent_joints,
    faulty_sensors,
    leading_findings,
    questions,
)
from handscope.app.results.make import assess_result, page_content
from handscope.app.results.result_view import calibration_payload, readings
from handscope.estimators.data.samples import Event
from handscope.estimators.measures.figure import Figure, Grade, Kind
from handscope.estimators.measures.resting_drift import Drift
from handscope.estimators.messages import Message
from handscope.estimators.messages.sentence import Sentence, phrase
from handscope.sessions.db.tables import PatientSession, RecordingFile, Result
from handscope.sessions.store.records import event_row
from tests.app.report.simulated_sessions import session

EN = languages()["en"]
LOST, LIMIT = "samples lost on their way", phrase("flag.saturated")


def figure(grade: Grade = "good", reason: str = "", value: float = 0.3) -> Figure:
    return Figure("spread", value, "rad", "x", None, grade, reason, "index_middle", "spread")


@pytest.mark.parametrize(
    ("poor", "fair", "calibrated", "answer"),
    [
        (0, 0, True, "yes"),
        (1, 0, True, "mostly"),
        (0, 1, True, "mostly"),
        (6, 0, True, "no"),
        (0, 0, False, "no"),
    ],
)
def test_the_answer_follows_the_grades_and_the_calibration(
    poor: int, fair: int, calibrated: bool, answer: str
) -> None:
    grades: list[Grade] = ["poor"] * poor + ["fair"] * fair + ["good"] * (10 - poor - fair)
    found = judge_trust(
        [("tapping", figure(g, LOST if g != "good" else "")) for g in grades], calibrated
    )
    assert found.answer == answer


def test_a_few_lost_samples_that_lower_no_grade_are_a_yes() -> None:
    found = judge_trust([("tapping", figure())] * 37, True)
    assert trust_payload(found, {}, EN)["words"] == "Yes. All 37 figures can be relied on."


def test_reasons_name_the_task_and_say_what_to_do() -> None:
    rows = [("tapping", figure("poor", LIMIT)), *[("rom_fist", figure())] * 5]
    told = trust_payload(judge_trust(rows, True), {"tapping": "Finger tapping"}, EN)
    assert told["words"] == "Mostly: 5 of 6 figures can be relied on."
    assert told["reasons"] == ["Finger tapping, 1 figure: sensor at its limit."]
    assert "more slowly" in told["todo"][0]


def test_a_task_with_too_few_movements_is_to_be_repeated_with_more() -> None:
    few = [
        figure("poor", phrase(code, count=10))
        for code in ("measure.too_few_taps", "measure.fewer_than")
    ]
    told = trust_payload(
        judge_trust([("open_close", f) for f in [*few, *[figure()] * 5]], True), {}, EN
    )
    assert told["todo"] == ["Repeat the task with more movements, ten at least."]


def test_a_spread_larger_than_healthy_people_reach_is_flagged() -> None:
    told = trust_payload(
        judge_trust([("rom_spread", figure(value=0.464))], True), {"rom_spread": "Spread"}, EN
    )
    assert told["answer"] == "mostly"
    assert "27°" in told["reasons"][0] and "17° ± 2.6°" in told["reasons"][0]


def test_a_change_from_tap_to_tap_is_no_angle_that_healthy_people_do_not_reach() -> None:
    growing = replace(
        figure(value=0.02),
        name="tapping_angle_decrement_slope",
        what="tapping_angle_decrement_slope",
        part="",
    )
    told = trust_payload(judge_trust([("tapping", growing)], True), {}, EN)
    assert (told["answer"], told["reasons"]) == ("yes", [])


def test_without_figures_the_answer_is_no() -> None:
    assert judge_trust([], True).answer == "no"


def test_a_session_of_tasks_that_were_not_done_has_no_figures_and_says_which_and_why() -> None:
    recording, processed, _ = session()
    could_not = {"task_name": "rom_fist", "outcome": "unable: Pain"}
    events = (Event(8.0, 0.0, "annotation", could_not),)
    file = RecordingFile(format="native", summary={"events": [event_row(e) for e in events]})
    result = Result(method="m2", recording=file)
    file.session = PatientSession(hand="left")
    rest = replace(recording, events=events)
    assert assess_result(result, rest, processed) == []
    told = readings(page_content(processed, [], rest), [], load_all(), EN)
    assert told["not_done"] == [["Fist and stretch", "patient could not", "Pain"]]
    assert told["trust"]["words"] == "No: there is no figure to rely on."
    file.original_name = "elsewhere.mcap"  # uploaded: all of it is measured
    assert assess_result(result, rest, processed)


def test_what_drifts_at_rest_is_told_with_its_size_and_what_to_do() -> None:
    drift = Drift("index", 30.0, 510.0, 0.0602, 0.0671, 9)
    told = trust_payload(judge_trust([("tapping", figure())], True, drifts=[drift]), {}, EN)
    assert told["answer"] == "mostly"
    assert all(part in told["reasons"][0] for part in ("index", "60 mm", "67 mm", "8.0 min"))
    assert "pose again" in told["todo"][0]


@pytest.mark.parametrize(("found", "answer"), [({"table": {}}, "yes"), (None, "no")])
def test_a_hand_that_calibrated_itself_without_a_pose_is_calibrated(
    found: dict[str, dict[str, float]] | None, answer: str
) -> None:
    rows = [asdict(figure()) | {"task": "rom_spread", "measure": "range_of_motion"}]
    content = {"calibration": {"quality": {}, "source": "free"}, "self_calibration": found}
    assert readings(content, rows, {}, EN)["trust"]["answer"] == answer


def test_joints_whose_calibration_is_fair_are_named() -> None:
    recording, processed, _ = session()
    (c, *_) = processed.calibrations
    turned = {**c.quality, "index_middle": replace(c.quality["index_middle"], misalignment=0.3)}
    made = replace(processed, calibrations=(replace(c, quality=turned),))
    content = page_content(made, [], recording)
    (words,) = calibration_payload(content["calibration"], EN)["joints"]
    assert words == "Calibration by joint: fair at Index PIP; Index DIP."


def test_what_was_not_tested_is_said_by_finger_and_changes_no_answer() -> None:
    untested = {
        "gyroscopes": ["hand", "ring_proximal", "ring_middle", "ring_distal"],
        "strips": ["index"],
        "fingers": ["middle", "ring"],
        "turns": ["little_distal"],
    }
    trust = judge_trust([("tapping", figure())], True)
    said = trust_payload(trust, {}, EN, untested=untested)
    assert said["answer"] == "yes"
    gyroscopes, strips, fingers, turns = said["untested"]
    assert "hand; ring" in gyroscopes
    assert "index" in strips
    assert "each other's place" in fingers and "middle; ring" in fingers
    assert "17°" in turns and "little" in turns
    assert trust_payload(trust, {}, EN)["untested"] == []


def flagged(segments: str, flag: str) -> str:
    share = phrase("processing.share_of_samples", what=phrase(flag), share=7.0)
    return phrase("processing.segments_flagged", segments=segments, what=share)


AT_LIMIT = flagged("index_distal", "flag.saturated")
GYROSCOPE = phrase(
    "fault.with_fix",
    sensor="index_distal",
    sentence=phrase("fault.at_limit", what="gyroscope", count=12, time=3.0),
    fix=phrase("fault.larger_range"),
)
NEGATED = Sentence(Message("sensor.accelerometer_negated", {"sensor": "ring_middle"}, "fault"))
DOUBTFUL, OTHERS = (
    Sentence(
        Message(
            "sensors.late",
            {"sensors": sensors, "delay_ms": 200.0, "start": 1.0, "stop": 9.0, "odds": 1e6},
            "warning",
        )
    )
    for sensors in ("ring_middle", "ring_middle, hand")
)
BENT = [("ring_pip", "31°")]
USED = phrase("contacts.used", contacts="thumb on index finger")
RECORDED = [USED, flagged("thumb_distal", "flag.magnetic"), AT_LIMIT, GYROSCOPE, NEGATED]


@pytest.mark.parametrize(
    ("warnings", "findings"),
    [
        (RECORDED, [NEGATED, GYROSCOPE]),  # the fault first, never more than two
        ([AT_LIMIT, GYROSCOPE], [GYROSCOPE]),  # a sensor once
        (RECORDED[:3], [AT_LIMIT]),  # what no figure's reason names stays folded
        (RECORDED[:2], []),
        ([DOUBTFUL, NEGATED], [NEGATED]),  # what follows from a fault
        ([OTHERS, NEGATED], [NEGATED, OTHERS]),
    ],
)
def test_the_sensors_that_lower_figures_are_named_beside_the_answer(
    warnings: list[str], findings: list[str]
) -> None:
    trust = judge_trust([("tapping", figure("poor", LIMIT)), ("tapping", figure())], True)
    assert leading_findings(trust, warnings) == findings
    assert leading_findings(judge_trust([("tapping", figure())], True), warnings) == []


@pytest.mark.parametrize(
    ("code", "values"),
    [
        ("fingers.exchanged", {"first": "index", "second": "ring", "odds": 3e4}),
        ("fingers.several_exchanged", {"fingers": "index, middle, ring", "odds": 3e4}),
        ("hand.other", {"odds": 3e4}),
    ],
)
def test_strips_on_other_fingers_and_the_other_hand_are_told_beside_the_answer(
    code: str, values: dict[str, float | str]
) -> None:
    trust = judge_trust([("tapping", figure("poor", phrase("flag.doubtful")))], True)
    found = phrase(code, **values)
    assert leading_findings(trust, [found]) == [found]


def test_joints_that_were_bent_in_the_pose_are_asked_about_apart_from_sensors() -> None:
    asked = Sentence(Message("person.bent_in_pose", {"joints": "ring_pip 31°"}, "info"))
    bone = {"segment": "ring_proximal", "seen_mm": 52.0, "declared_mm": 40.0}
    other = Sentence(Message("person.bone_length", bone, "info"))
    doubtful = judge_trust([("rom_fist", figure("poor", LIMIT))], True, bent=BENT)
    assert questions([other, asked, NEGATED]) == [asked]
    assert bent_joints([other, asked, NEGATED, asked]) == BENT
    assert leading_findings(doubtful, [other, asked, NEGATED]) == [NEGATED]


@pytest.mark.parametrize(
    ("grade", "words"),
    [
        ("good", "Mostly: all 2 figures can be relied on but those of the joints named below."),
        ("poor", "Mostly: 1 of 2 figures can be relied on."),
    ],
)
def test_an_open_question_about_the_pose_is_no_yes(grade: Grade, words: str) -> None:
    rows = [("rom_fist", figure(grade, LIMIT)), ("rom_fist", figure())]
    told = trust_payload(judge_trust(rows, True, bent=BENT), {}, EN)
    assert (told["answer"], told["words"]) == ("mostly", words)


def test_a_report_says_it_with_the_reasons_and_the_joints_that_were_bent() -> None:
    rows = [("", figure("fair", LIMIT)), ("", figure())]
    trust = judge_trust(rows, True, faulty=["index_middle"], bent=BENT)
    answer, mostly, bent, faulty, doubt = trust_sentences(trust, {}, EN)
    assert answer.endswith("?") and mostly.startswith("Mostly: 1 of 2")
    assert "Ring PIP 31°" in bent and "index" in faulty and "sensor at its limit" in doubt


def test_figures_that_one_thing_makes_doubtful_are_one_reason_with_their_joints() -> None:
    kind, doubtful = Kind("flexion_max", "rad", "x", "x"), phrase("flag.doubtful")
    worn = [kind.of(0.3, sd, "fair", doubtful, "index_pip") for sd in (0.5, 0.9)]
    bent = [kind.of(0.3, sd, part=joint) for joint, sd in (("ring_pip", 0.2), ("ring_dip", 0.3))]
    rows = [("", f) for f in (*worn, *bent, *[figure()] * 5)]
    assert trust_payload(judge_trust(rows, True), {}, EN)["reasons"] == [
        f"Whole recording, 2 figures (Index PIP): {doubtful}.",
        "Whole recording, 2 figures (Ring PIP; Ring DIP): standard deviations of up to 17 deg.",
    ]


def test_a_faulty_sensor_whose_joints_have_no_figures_is_no_yes() -> None:
    found = judge_trust([("rom_fist", figure())] * 5, True, faulty=["index_middle"])
    told = trust_payload(found, {}, EN)
    assert told["answer"] == "mostly"
    assert "index" in told["reasons"][0] and "Faulty sensor" in told["reasons"][0]
    assert any("exchange a sensor" in what for what in told["todo"])


def test_faulty_sensors_are_those_that_messages_of_faults_name() -> None:
    identical = Message("sensors.identical", {"first": "ring_middle", "second": "hand"}, "fault")
    texts = [Sentence(identical), DOUBTFUL]
    assert faulty_sensors(texts) == ["ring_middle", "hand"]
