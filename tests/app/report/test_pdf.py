"""The PDF: everything on it, any text literally, the same bytes for the same content."""

import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from io import BytesIO

import numpy as np
import pytest
from pypdf import PdfReader

from handscope.app.language import ENGLISH, Language, languages
from handscope.app.protocols.plans import built_in, named
from handscope.app.report import FORMS, Style
from handscope.app.report.content import Content, GoalReading, NotDone
from handscope.app.report.html import html
from handscope.app.report.page import Page, words_of
from handscope.app.report.pdf import pdf
from handscope.app.report.summary import not_done_row
from handscope.estimators.data.samples import Event
from handscope.estimators.measures import tapping
from handscope.estimators.measures.assessment import assess
from handscope.estimators.methods import m2
from handscope.sessions.clinic.references import Course
from handscope.sessions.clinic.references import Visit as CourseVisit
from tests.app.report.simulated_sessions import (
    CHECKSUM,
    NORMAL,
    ROM,
    VISIT,
    gap_in_the_little_finger,
    report,
    session,
)

NASTY = (
    "Łódź <b>x</b> & #let $x^2$ *y* _z_ @ref \\ `r` -- ... \"q\" 'p' [l](m) {n} //c /*d*/ Ελ Кир עב"
)


GERMAN, FRENCH = languages()["de"], languages()["fr"]
MORNING = datetime(2026, 5, 12, 9, 30, tzinfo=UTC)
TAG, NOTICE = ENGLISH.say("notice.short"), ENGLISH.say("notice")


def pdf_(c: Content, language: Language = ENGLISH, paper: str = "a4") -> bytes:
    return pdf(c, language, paper)


def page_of(c: Content) -> Page:
    return words_of(c, ENGLISH)


def pages(made: bytes) -> int:
    return made.count(b"/Type/Page/")


def printed(made: bytes) -> str:
    """The text of the PDF with runs of white space as one space."""
    return " ".join(
        " ".join(page.extract_text() for page in PdfReader(BytesIO(made)).pages).split()
    )


def text_of(c: Content) -> str:
    return printed(pdf_(c))


@cache
def usual() -> bytes:
    """Of a normal session, made once."""
    return pdf_(report())


@cache
def usual_text() -> str:
    return printed(usual())


@pytest.mark.parametrize(
    ("paper", "size"), [("a4", rb"595\.27\d* 841\.8\d*"), ("us-letter", rb"612 792")]
)
def test_a_normal_session_is_three_pages_of_the_paper_asked_for(paper: str, size: bytes) -> None:
    made = pdf_(report(), paper=paper)
    assert made.startswith(b"%PDF-1.7")
    assert pages(made) == 3
    assert re.search(rb"/MediaBox\[0 0 " + size + rb"\]", made)


def test_a_french_report_has_the_same_pages_its_own_words_and_no_character_that_the_fonts_lack() -> (
    None
):
    made = pdf_(report(), FRENCH)
    text = printed(made)
    assert pages(made) == 3
    assert "[U+" not in text
    for words in (
        "Bilan de la main",
        "21 novembre 2026",
        "Tapotement des doigts : fréquence de tapotement 2,50 par s",
        "Auriculaire",
        "posture initiale, 1,5 à 4,5 s, 17 capteurs",
        "Amplitudes articulaires",
        "Index IPP",
        "Pouce : flexion active totale (TAF)",
    ):
        assert words in text
    assert "Range of motion" not in text and " PIP" not in text


def test_three_trials_of_tapping_still_are_three_pages() -> None:
    assert pages(pdf_(report(session((*NORMAL, "tapping", "tapping"))))) == 3


def test_a_single_task_is_one_page() -> None:
    assert pages(pdf_(report(session(("initial_pose", "tapping"))))) == 1


def test_a_session_without_an_accepted_task_says_so_and_why_tasks_were_not_done() -> None:
    recording, processed, _ = session()
    skipped = Event(8.0, 0.0, "annotation", {"task_name": "tapping", "outcome": "skipped: Pain"})
    events = (*(e for e in recording.events if e.trial_type != "task"), skipped)
    made = report((replace(recording, events=events), processed, ()))
    text = text_of(made)
    assert pages(pdf_(made)) == 1
    assert "No task was accepted in this session, so there are no figures to report." in text
    assert "Not done: Finger tapping (skipped, Pain)." in text
    assert "Nicht gemacht: Fingertippen (ausgelassen, Pain)." in printed(pdf_(made, GERMAN))
    missed = NotDone("phrase", "skipped", "no_time")  # of those that the page offers
    assert not_done_row(missed, GERMAN)[1:] == ["ausgelassen", "Keine Zeit"]


def test_a_whole_recording_without_tasks_is_said_to_be_one() -> None:
    recording, processed, _ = session()
    made = assess(processed.trajectory, [e for e in recording.events if e.trial_type != "task"])
    assert "The recording names no accepted task." in text_of(
        report((recording, processed, tuple(made)))
    )


def test_every_word_and_number_of_the_page_is_printed() -> None:
    page, text = page_of(report()), usual_text()
    cells = [
        words
        for row in page["ranges"][0]["table"]["rows"]
        for words in (row["finger"], row["joint"], *(c[0] for c in row["cells"]))
    ]
    cells += [cell for row in page["tapping"][0]["rows"] for cell in row]
    cells += [cell for row in page["calibration"]["rows"] for cell in row]
    cells += [
        cell for row in [*page["facts"], *page["signal"], *page["provenance"]] for cell in row[1:]
    ]
    for words in [
        *cells,
        *page["summary"],
        *(c[1] for c in page["checksums"]),
        *page["calibration"]["summaries"],
        TAG,
        NOTICE,
        "Signature",
        "Pain 2/10 on full flexion.",
    ]:
        for word in words.split():
            assert word in text, words
    assert CHECKSUM in text


def test_the_numbers_are_those_that_were_measured() -> None:
    text, tapping = usual_text(), session()[2][-1].details
    assert f"Taps {tapping.count} " in text
    assert re.search(rf"Rate {tapping.rate:.2f} per s", text)
    assert re.search(rf"Amplitude, mean {1e3 * tapping.amplitudes.mean():.1f} ± \d+\.\d mm", text)
    assert re.search(
        r"Ring MCP 80° ± \d\.\d° 85–90° 1\d° hyperextension 1\d° abd\., \d° add\.", text
    )
    wrist = {
        f.name: abs(round(float(np.degrees(f.value))))
        for f in session()[2][-2].figures
        if f.name.startswith("wrist")
    }
    bent, stretched, ulnar, radial = (
        wrist[f"wrist_{name}"]
        for name in ("flexion_max", "flexion_min", "deviation_max", "deviation_min")
    )
    assert re.search(
        rf"Wrist {bent}° ± \d\.\d° 80° {stretched}° {radial}° radial, {ulnar}° ulnar",
        text,
    )


def test_no_angle_is_printed_with_a_bare_sign() -> None:
    text = usual_text()
    assert "°" in text
    assert not re.search(r"[-−+±]\s?\d+°", text)


def test_text_prints_literally() -> None:
    visit = replace(
        VISIT, patient="<i>P</i> & #1", examiner="$A$ *B*", notes=NASTY + "\r\nsecond line"
    )
    text = text_of(report(visit=visit, source={"device": "#glove *7*"}))
    for words in (
        "<i>P</i> & #1",
        "$A$ *B*",
        NASTY[: NASTY.index("עב")].strip(),
        "second line",
        "#glove *7*",
    ):
        assert words in text
    assert "[U+" not in text


def test_characters_without_a_glyph_are_printed_by_their_number() -> None:
    assert "a[U+4E2D]b [U+0007] [U+1F600] c [U+6587]" in text_of(
        report(visit=replace(VISIT, notes="a中b \x07 😀 c 文"))
    )
    assert "[U+FEFF]first" in text_of(report(visit=replace(VISIT, patient="\ufefffirst")))


@pytest.mark.usefixtures("drawn_anew")
def test_the_same_content_gives_the_same_bytes_also_in_parallel() -> None:
    with ThreadPoolExecutor(3) as pool:
        made = list(pool.map(lambda _: pdf_(report()), range(2)))
    assert made[0] == made[1] == usual()


def test_the_document_is_dated_by_the_session() -> None:
    assert b"2026-11-21T10:32:00" in usual()
    assert b"1970-01-01" in pdf_(report(visit=replace(VISIT, date=None), start_utc=None))


def test_the_document_is_tagged_and_declares_its_standards() -> None:
    made = usual()
    for mark in (b"/StructTreeRoot", b"/Lang", b"pdfuaid:part", b"pdfaid:part"):
        assert mark in made


def test_a_session_without_tapping_says_so() -> None:
    text = text_of(report(session(("initial_pose", *ROM))))
    assert "Finger tapping was not part of this session." in text
    assert "Range of motion was not part" not in text


def test_a_session_without_range_of_motion_says_so() -> None:
    text = text_of(report(session(("initial_pose", "tapping"))))
    assert "Range of motion was not part of this session." in text
    assert "Taps" in text


def test_a_trial_without_taps_says_so() -> None:
    recording, processed, results = session()
    still = replace(results[-1], onset=1.5, end=4.4)  # within the initial pose
    details = tapping.measure(tapping.Params(), processed.trajectory, still.onset, still.end)
    none = replace(still, details=details, figures=tuple(tapping.figures(details)))
    text = text_of(report((recording, processed, (none,))))
    assert "No complete tap was found, so there is no curve to show." in text
    assert "not measured" in text
    assert "Poor signal, no complete tap found." in text


@pytest.mark.parametrize(
    ("slope", "words"),
    [
        (-0.00052, "0.52 mm smaller"),
        (0.0004, "0.40 mm larger"),
        (0.000001, "no change"),
        (float("nan"), "too few taps"),
    ],
)
def test_a_change_of_amplitude_is_said_in_words(slope: float, words: str) -> None:
    recording, processed, results = session()
    figures = tuple(
        replace(f, value=slope) if f.name == "tapping_decrement_slope" else f
        for f in results[-1].figures
    )
    changed = replace(results[-1], figures=figures)
    (section,) = page_of(report((recording, processed, (changed,))))["tapping"]
    assert ["Change per tap", "", words] in section["rows"]


def test_poor_signal_is_said_with_its_reason() -> None:
    text = text_of(report(session(change=gap_in_the_little_finger)))
    assert re.search(
        r"Poor signal of Little MCP, Little PIP: samples missing and bridged in \d+ % of the samples\.",
        text,
    )
    assert re.search(r"samples missing and bridged \(worst: little proximal, 3\d %\)", text)
    assert "Warnings. little proximal" in text
    assert (
        "Index PIP"
        not in text.replace("Index MCP", "").split("Flexion in degrees")[0].split("Poor signal")[1]
    )


def test_the_summary_counts_the_figures_that_the_page_counts() -> None:
    made = report()
    shown = [f for task in made.tasks for f in task.result.figures if not f.detail]
    assert len(shown) < sum(len(task.result.figures) for task in made.tasks)
    counted = [
        words for words in page_of(made)["summary"] if f"Yes. All {len(shown)} figures" in words
    ]
    assert len(counted) == 1, page_of(made)["summary"]


def test_fingers_that_are_not_measured_are_named() -> None:
    segments = (
        "hand",
        "thumb_metacarpal",
        "thumb_proximal",
        "thumb_distal",
        "index_proximal",
        "index_middle",
        "index_distal",
    )
    text = text_of(report(session(("initial_pose", "rom_thumb", "tapping"), segments=segments)))
    assert "Without sensors: wrist, middle, ring, little." in text
    assert "Not asked for, or without usable samples: index." in text


def test_tasks_beyond_the_range_of_motion_follow_on_a_page_of_their_own_without_deficits() -> None:
    made = pdf_(report(session((*NORMAL, "wiggle"))))
    assert pages(made) == 3
    further = printed(made).split("Further tasks")[1]
    assert "wiggle" in further
    assert "not below" in further
    assert "deficit" not in further
    assert "reference values" not in further
    assert further.count(TAG) >= 1  # in the footer


def test_long_notes_go_on_and_nothing_is_lost() -> None:
    made = pdf_(report(visit=replace(VISIT, notes="\n".join(f"line {k}" for k in range(40)))))
    assert pages(made) == 3
    text = printed(made)
    assert all(f"line {k} " in text for k in range(40))
    last = PdfReader(BytesIO(made)).pages[-1].extract_text()
    assert "Signature" in last
    assert "Checksums" in last  # it never stands on a page of its own


def test_conclusion_pain_and_goals_stand_on_the_first_page_where_there_are_any() -> None:
    visit = replace(VISIT, conclusion="Stiffer than\nin May.", pain={"rest": 0, "movement": 7})
    goal = GoalReading("index_pip_flexion_max", 78.4, "deg", 80.0, 105.0)
    made = replace(report(visit=visit), goals=(goal,))
    first = " ".join(PdfReader(BytesIO(pdf(made, ENGLISH))).pages[0].extract_text().split())
    assert "Conclusion Stiffer than in May." in first
    assert "Pain on the numerical rating scale (0 to 10): at rest 0 and on movement 7." in first
    assert "78° 80 to 105° not reached" in first
    words = html(made, ENGLISH).decode()
    assert "Stiffer than\nin May." in words and "not reached" in words
    without = html(report(), ENGLISH).decode()
    assert "Conclusion" not in without and "numerical rating scale" not in without


def test_both_hands_of_a_visit_stand_side_by_side_on_the_first_page() -> None:
    key, alone = ("tapping", "tapping", "tapping_rate"), ("tapping", "tapping", "tapping_width")
    tam = ("total_active_motion", "rom_fist", "index_tam")
    own = {key: (2.0, "Hz"), alone: (1.0, "m"), tam: (np.pi, "rad")}
    theirs = {key: (2.5, "Hz"), tam: (1.25 * np.pi, "rad")}
    course = Course((CourseVisit(MORNING, own),), CourseVisit(MORNING, theirs))
    together = replace(report(), course=course, same_visit=True)
    first = " ".join(PdfReader(BytesIO(pdf(together, ENGLISH))).pages[0].extract_text().split())
    assert "Both hands The other hand was measured in the same visit, 12 May 2026, 09:30" in first
    assert "2.00 per s 2.50 per s 80 %" in first
    assert "Index: total active motion (TAM) 180° 225° 80 %" in first
    assert "2.50 per s" in html(together, ENGLISH).decode()
    apart = html(replace(together, same_visit=False), ENGLISH).decode()
    assert "Both hands" not in apart


def test_the_facts_name_the_protocol_and_its_version() -> None:
    plan = named(built_in()["flexor_tendon_repair"])
    led = report(visit=replace(VISIT, protocol={**plan, "version": 3}))
    first = " ".join(PdfReader(BytesIO(pdf(led, ENGLISH))).pages[0].extract_text().split())
    assert "Protocol: Flexor tendon repair, version 3" in first
    title = GERMAN.translate(plan["title"])
    assert title != plan["title"]
    assert f"Protokoll: {title}, Version 3" in html(led, GERMAN).decode()
    assert "Protocol:" not in html(report(), ENGLISH).decode()


def test_options_that_were_changed_and_facts_that_are_unknown_are_said() -> None:
    unknown = replace(VISIT, date=None, examiner="")
    text = text_of(
        report(
            visit=unknown,
            params=m2.Params(max_gap=0.1),
            start_utc=None,
            checksum="",
            source={},
            losses={},
        )
    )
    for words in (
        "max_gap = 0.1 s (default 0.25)",
        "date not recorded",
        "not given",
        "losses not recorded",
        "not known",
    ):
        assert words in text
    assert "all at their defaults" in usual_text()


def test_warnings_beyond_the_first_are_counted() -> None:
    recording, processed, results = session()
    many = replace(processed, warnings=tuple(f"warning {k}" for k in range(13)))
    said = page_of(report((recording, many, results)))["warnings"]
    assert said == [*(f"warning {k}" for k in range(8)), "5 more in the session's JSON file"]


def test_streams_of_one_kind_are_told_together() -> None:
    recording, processed, results = session()
    imu = recording.samples["imu"]
    strips = {
        name: replace(imu, stream=replace(imu.stream, name=name, sensors=(name,)))
        for name in ("hand", "forearm")
    }
    said = page_of(
        report(
            (
                replace(recording, samples=strips, losses={"hand": 2, "forearm": 1}),
                processed,
                results,
            ),
            losses={"hand": 2, "forearm": 1},
        )
    )
    assert said["signal"][0] == [
        "Streams",
        f"hand, forearm: 2 sensors at 60 Hz, samples: {2 * len(imu.t):,}, 3 lost",
    ]


def test_every_form_is_handed_out() -> None:
    assert set(FORMS) == {"pdf", "html", "csv", "json"}
    starts = {form: make(report(), Style())[:5] for form, make in FORMS.items()}
    assert starts == {"pdf": b"%PDF-", "html": b"<!doc", "csv": b"# Res", "json": b'{\n  "'}


def test_every_row_of_the_ranges_has_its_joint_as_header_and_none_an_empty_one() -> None:
    words = html(report(), ENGLISH).decode()
    assert '<th scope="row" class="joint">PIP</th>' in words
    assert not re.search(r"<th[^>]*></th>", words)
