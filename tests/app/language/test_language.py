"""Languages of what the server writes: every language says everything, sentences written elsewhere are recognised, numbers have the locale's form."""

import json
import re
import time
from datetime import UTC, date, datetime
from importlib.resources import files

import pytest

from handscope.app.auth.audit_hooks import LISTS
from handscope.app.language import ENGLISH, NAME, Language, language, languages, preferred
from handscope.app.protocols import load_all, load_steps
from handscope.app.protocols.plans import built_in
from handscope.app.report.words import figure_words
from handscope.estimators.data.options import describe
from handscope.estimators.data.trajectory import FLAG_WORDS
from handscope.estimators.errors import InputError
from handscope.estimators.measures import MEASURES
from handscope.estimators.messages import english_texts
from handscope.estimators.messages.sentence import codes_of, join, phrase
from handscope.estimators.methods import METHODS
from handscope.sessions.clinic.audit import BY_ITSELF, KINDS
from handscope.sessions.db.conflicts import ConflictError
from handscope.sessions.db.full_disk import FULL
from handscope.sessions.db.tables import Account, Base, Correction, Note, Patient, PatientSession

GERMAN, FRENCH = languages()["de"], languages()["fr"]
OTHERS = [one for one in languages().values() if one is not ENGLISH]
MOMENT = datetime(2026, 11, 5, 7, 3, tzinfo=UTC)


def code(one: Language) -> str:
    return one.code


@pytest.mark.parametrize("other", OTHERS, ids=code)
def test_every_word_of_the_server_is_in_every_language_with_the_same_gaps(other: Language) -> None:
    words = json.loads(
        files("handscope.app.language").joinpath(f"{other.code}.json").read_text("utf-8")
    )["words"]
    assert {k: sorted(NAME.findall(w)) for k, w in words.items() if k in ENGLISH.words} == {
        k: sorted(NAME.findall(w)) for k, w in ENGLISH.words.items()
    }


@pytest.mark.parametrize("one", languages().values(), ids=code)
def test_a_counted_word_has_every_plural_form_that_counts_below_a_million_take(
    one: Language,
) -> None:
    """Of a million French says `many`, for "1 million de séances"; in digits that is `other`, which stands in."""
    forms = {one.locale.plural_form(count) for count in range(1000)}
    own = json.loads(
        files("handscope.app.language").joinpath(f"{one.code}.json").read_text("utf-8")
    )
    for part, english in (("pages", ENGLISH.pages), ("words", ENGLISH.words)):
        counted = {key.removesuffix(".one") for key in english if key.endswith(".one")}
        assert {f"{key}.{form}" for key in counted for form in forms} - own[part].keys() == set()
    for message, text in own.get("messages", {}).items():
        if not isinstance(english_texts()[message], str):
            assert isinstance(text, str) or forms <= text.keys(), message


def test_colons_semicolons_and_joints_are_set_as_the_language_has_them() -> None:
    assert (ENGLISH.labelled("a", "b"), FRENCH.labelled("a", "b")) == ("a: b", "a\u00a0: b")
    assert (GERMAN.several("ab"), FRENCH.several("ab")) == ("a; b", "a\u00a0; b")
    assert (ENGLISH.joint("pip"), FRENCH.joint("pip"), FRENCH.joint("mcp")) == ("PIP", "IPP", "MCP")


def test_french_punctuation_has_its_no_break_spaces() -> None:
    own = json.loads(files("handscope.app.language").joinpath("fr.json").read_text("utf-8"))
    words = [*own["pages"].values(), *own["words"].values()]
    for text in own["messages"].values():
        words += [text] if isinstance(text, str) else text.values()
    assert [text for text in words if re.search(r" [:;?!%»](?=[\s.,)]|$)|«(?!\u00a0)", text)] == []


@pytest.mark.parametrize("language", ["en", "de"])
def test_an_ellipsis_and_a_percent_sign_stay_on_the_line_of_what_is_before_them(
    language: str,
) -> None:
    text = files("handscope.app.language").joinpath(f"{language}.json").read_text("utf-8")
    assert re.findall(r".{12} …|\d %", text) == []


def test_none_is_singular_in_french() -> None:
    said = [FRENCH.counted("trust.figures", count) for count in (0, 1, 2)]
    assert said == ["0 valeur", "1 valeur", "2 valeurs"]


def test_a_text_is_translated_by_its_codes_and_never_by_its_words() -> None:
    slipped, carried = phrase("force_flag.slip"), phrase("lift.carried")
    together = join([slipped, carried])
    parts = [GERMAN.translate(one) for one in (slipped, carried)]
    assert not {slipped, carried} & set(parts)
    assert GERMAN.translate(together) == "; ".join(parts)
    assert ENGLISH.translate(together) == together
    without_codes = str.__str__(together)
    assert GERMAN.translate(without_codes) == without_codes


def test_an_unknown_sentence_is_said_as_it_is_with_segments_named_and_numbers_in_form() -> None:
    assert (
        GERMAN.translate("little_proximal drifted by 1.25 deg since 10.11.2026, v1.2.3")
        == "Kleinfinger Grundglied drifted by 1,25 deg since 10.11.2026, v1.2.3"
    )
    assert (
        ENGLISH.translate("little_proximal drifted by 1.25 deg")
        == "little proximal drifted by 1.25 deg"
    )
    assert GERMAN.translate("x" * 10_000 + " in 5 % of the samples").startswith("xxx")


def test_numbers_and_days_have_the_locales_form() -> None:
    assert (ENGLISH.number(1234.567, 2), GERMAN.number(1234.567, 2)) == ("1,234.57", "1.234,57")
    assert (ENGLISH.number(-0.001, 1), GERMAN.number(2.5)) == ("0.0", "2")
    assert (ENGLISH.day(MOMENT), GERMAN.day(MOMENT)) == ("5 November 2026", "5. November 2026")
    assert (FRENCH.number(1234.567, 2), FRENCH.day(MOMENT)) == ("1\u202f234,57", "5 novembre 2026")
    assert GERMAN.hour(MOMENT) == "07:03 UTC"
    assert GERMAN.read_in("Europe/Berlin").hour(MOMENT) == "08:03"
    assert GERMAN.read_in("Pacific/Auckland").day(MOMENT.replace(hour=22)) == "6. November 2026"
    for strange in ("", "../../etc/passwd", "Nowhere/Never", "A" * 4000):
        assert GERMAN.read_in(strange).hour(MOMENT) == "07:03 UTC"
    assert GERMAN.all_of(["a", "b", "c"]) == "a, b und c"


def test_a_moment_is_written_as_the_clocks_show_it_where_the_server_stands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()
    try:
        late = datetime(2026, 7, 5, 22, 30, tzinfo=UTC)
        assert (ENGLISH.day(late), ENGLISH.hour(late)) == ("6 July 2026", "00:30 CEST")
        assert ENGLISH.short_day(late) == "6 Jul 2026"
        assert ENGLISH.day(date(2026, 7, 5)) == "5 July 2026"
    finally:
        monkeypatch.undo()
        time.tzset()


@pytest.mark.parametrize(
    ("accepted", "found"),
    [
        ("", "en"),
        ("de", "de"),
        ("de-AT,de;q=0.9,en;q=0.8", "de"),
        ("it,en;q=0.5,de;q=0.7", "de"),
        ("fr-CA,en;q=0.5", "fr"),
        ("tlh", "en"),
        ("de;q=x,,;", "en"),
        ("en-US,de", "en"),
    ],
)
def test_the_browsers_preferred_language_is_taken_where_there_is_one(
    accepted: str, found: str
) -> None:
    assert preferred(accepted).code == found


def test_a_language_that_there_is_not_is_said() -> None:
    with pytest.raises(
        InputError, match=re.escape("there is no language 'xx'; languages are en, de, fr")
    ):
        language("xx")


def test_what_a_patients_page_refuses_is_said_in_german() -> None:
    said = [
        GERMAN.translate(str(ConflictError(what)))
        for what in (
            phrase("conflict.patient_by_code", code="H-017"),
            phrase("conflict.patient"),
            phrase("conflict.note"),
        )
    ]
    assert all(sentence.endswith("wählen Sie") for sentence in said)
    assert "'H-017'" in said[0]
    assert GERMAN.translate(FULL).startswith("Der Datenträger ist voll")


@pytest.mark.parametrize("other", OTHERS, ids=code)
def test_tasks_methods_and_measures_are_told_in_every_language(other: Language) -> None:
    protocols = [*load_all().values(), *load_steps().values()]
    plans = [w for p in built_in().values() for w in (p.title, p.note, *p.sources) if w]
    said = [
        words
        for p in protocols
        for words in (p.title, p.instruction, *(phase.say for phase in p.cycle))
    ]
    said += [m.TITLE for m in (*METHODS.values(), *MEASURES.values())] + [*FLAG_WORDS.values()]
    assert [
        words for words in (*said, *plans) if not codes_of(words) <= other.messages.keys()
    ] == []
    assert [words for words in (*said, *plans) if not codes_of(words)] == []


def test_every_figure_of_every_measure_has_a_name_in_words() -> None:
    plain = [
        k.what.replace("_", " ").capitalize() for m in MEASURES.values() for k in m.KINDS.values()
    ]
    named = [figure_words(k.what, ENGLISH) for m in MEASURES.values() for k in m.KINDS.values()]
    ends = ("max", "min", "range")  # of joints' angles, which are named by their joint
    assert [
        words
        for words, raw in zip(named, plain)
        if words == raw and not raw.endswith(ends) and " " in raw
    ] == []


def test_a_line_of_the_audit_trail_has_words_for_what_was_done_to_what() -> None:
    does = {
        "created",
        "changed",
        "erased",
        "viewed",
        "exported",
        "refused",
        "logged_in",
        "logged_out",
    }
    kinds = {*KINDS.values(), *LISTS.values(), "code", "login", "request"}
    once = {
        "id",
        "created",
        "written",
        "made",
        "kind",
        "onset",
        "end",
        "reason",
        "event",
        "recording_id",
    }  # written with the row
    rows: tuple[type[Base], ...] = (Patient, Note, PatientSession, Correction, Account)
    fields = {
        c.key
        for row in rows
        for c in row.__table__.columns
        if c.key not in once | BY_ITSELF.get(row, frozenset())
    }
    wanted = (
        {f"audit.does.{d}" for d in does}
        | {f"audit.kind.{k}" for k in kinds}
        | {f"audit.field.{f}" for f in fields}
    )
    for one in languages().values():
        own = json.loads(
            files("handscope.app.language").joinpath(f"{one.code}.json").read_text("utf-8")
        )["pages"]
        assert wanted - set(own) == set()


def test_every_value_that_a_methods_option_offers_has_words() -> None:
    offered = {c for m in METHODS.values() for d in describe(m.Params) for c in d.choices}
    assert {f"choice.{c}" for c in offered} <= ENGLISH.words.keys()


def test_a_list_of_sentences_of_a_snapshot_is_translated_as_one_is() -> None:
    said = phrase("live.not_now")
    given = {"calibration": {"warnings": [said], "source": "pose"}, "message": said}
    german = languages()["de"].translate_keys(given, ("warnings", "message"))
    assert german["calibration"] == {"warnings": [german["message"]], "source": "pose"}
    assert german["message"] != said
