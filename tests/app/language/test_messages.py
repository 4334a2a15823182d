"""Messages by code: every language has every code that the source raises, and each value is filled in by the site and used by the words."""

import ast
import pickle
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from handscope.app.api.methods import meaning_of, source_of
from handscope.app.language import ENGLISH, Language, languages
from handscope.app.language.codes import table
from handscope.app.protocols import load_all, load_free, load_steps
from handscope.app.protocols.plans import built_in
from handscope.app.report.norms import norms, published_changes
from handscope.app.report.references import references, smallest_change
from handscope.estimators.data.options import describe
from handscope.estimators.errors import InputError
from handscope.estimators.measures import MEASURES
from handscope.estimators.messages import GAP, Message, Text, english_texts
from handscope.estimators.messages.sentence import PLAIN, codes_of
from handscope.estimators.methods import OFFERED

ROOT = Path(__file__).parents[3]
ROOMS = ("sessions", "estimators", "app")
FINDINGS = (
    "estimators/fault_detection/",
    "estimators/recording_checks/",
)  # its messages have words of their own
OTHERS = [one for one in languages().values() if one is not ENGLISH]
GERMAN = languages()["de"]
SAME = {  # words that a language has, too
    "de": ["measure_title.tremor", "task_title.kapandji"],
    "fr": ["quantity.gyroscope", "task_phase.finger_independence_2", "task_title.kapandji"],
}
WORDS = re.compile("[a-z]{2}")
PUBLISHED = re.compile(r"\b(19|20)\d\d\b|PMC\d+|Hand Surgery|mhealthtools|^[A-Z][\w -]+$")
OURS = re.compile(r"\b(ours|thesis|as in|and the|after the)\b")
CODE = re.compile(r"[a-z0-9_]+\.[a-z0-9_]+")


@cache
def sites() -> tuple[tuple[str, ast.Call], ...]:
    """Every call in these rooms that makes an error or a message, with where it stands."""
    return tuple(_sites())


def _sites() -> Iterator[tuple[str, ast.Call]]:
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*.py")):
            if path.relative_to(ROOT).as_posix().startswith(FINDINGS):
                continue
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                match node:
                    case ast.Call(
                        func=ast.Name(id="InputError" | "Message" | "phrase"), args=[_, *_]
                    ):
                        yield f"{path.relative_to(ROOT)}:{node.lineno}", node


def code_of(call: ast.Call) -> str | None:
    match call.args[0]:
        case ast.Constant(value=str(code)):
            return code
    return None


def gaps(text: Text) -> set[str]:
    forms = [text] if isinstance(text, str) else text.values()
    return {gap[1] for form in forms for gap in GAP.finditer(form)}


@cache
def found_codes() -> tuple[re.Pattern[str], ...]:
    """What the checks of a recording may find, where the code's parts come together: "{scope}.gyroscope_sign"."""
    patterns = set()
    for folder in FINDINGS:
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                match node:
                    case ast.Constant(value=str(code)) if CODE.fullmatch(code):
                        patterns.add(re.escape(code))
                    case ast.JoinedStr(values=parts) if re.search(
                        "[a-z]{4}", "".join(map(_text, parts))
                    ):
                        gapped = "".join(re.escape(_text(p)) or "[a-z_]+" for p in parts)
                        patterns.add(gapped)
    return tuple(map(re.compile, patterns))


def _text(part: ast.expr) -> str:
    return part.value if isinstance(part, ast.Constant) and isinstance(part.value, str) else ""


def coded_sites() -> list[tuple[str, ast.Call, str]]:
    return [(where, call, code) for where, call in sites() if (code := code_of(call))]


def test_every_code_that_is_raised_has_words_and_every_code_is_raised() -> None:
    found = {code for code in english_texts() if any(p.fullmatch(code) for p in found_codes())}
    raised = {code for _, _, code in coded_sites()} | {PLAIN}
    of_tasks = {code for text in task_texts() for code in codes_of(text)}
    others = {code for text in (*sources(), *notes()) for code in codes_of(text)}
    assert raised | found | of_tasks | others | of_options() == english_texts().keys()


def notes() -> list[str]:
    """What is remarked beside a reference value."""
    return [one.note for one in (*norms(), *references()) if one.note]


def sources() -> list[str]:
    """Where tasks, reference values and figures come from."""
    of_values = [n.source for n in (*norms(), *references())]
    of_values += [c.source for c in (*published_changes().values(), smallest_change())]
    tasks = [*load_all().values(), *load_steps().values(), load_free()]
    figures = [kind.source for m in MEASURES.values() for kind in m.KINDS.values()]
    words = [w for one in of_values for w in (one.name, one.reference)]
    return [text for text in (*words, *(p.source for p in tasks), *figures) if text]


def test_a_source_without_a_code_is_a_reference_to_what_others_published() -> None:
    plain = {text for text in sources() if not codes_of(text)}
    assert [text for text in plain if not PUBLISHED.search(text) or OURS.search(text)] == []


def test_every_figure_of_our_own_measures_says_what_it_means_by_a_code() -> None:
    kinds = [kind for m in MEASURES.values() for kind in m.KINDS.values()]
    assert [kind.what for kind in kinds if not codes_of(kind.meaning)] == []


def of_options() -> set[str]:
    """Codes of what the options of the methods that come with the program mean and rest on."""
    methods = [(name, describe(method.Params)) for name, method in OFFERED.items()]
    each = [(name, option) for name, options in methods for option in options]
    return {
        code
        for one in each
        for text in (meaning_of(*one), source_of(*one))
        for code in codes_of(text)
    }


def test_every_option_of_a_method_that_a_page_offers_has_a_code() -> None:
    """A method of somebody else's may have none: its own words are said then."""
    assert [
        (name, option.name)
        for name in ("b", "m1", "m2", "ekf", "map")
        for option in describe(OFFERED[name].Params)
        if not codes_of(meaning_of(name, option))
    ] == []


def task_texts() -> list[str]:
    """Every text of the tasks and plans that come with the program."""
    tasks = [*load_all().values(), *load_steps().values(), load_free()]
    texts = [t for p in tasks for t in (p.title, p.instruction, *(c.say for c in p.cycle))]
    texts += [text for p in tasks if p.score for text in (p.score.title, p.score.hint) if text]
    plans = built_in().values()
    return texts + [t for plan in plans for t in (plan.title, *plan.sources, plan.note) if t]


def test_every_text_of_our_own_tasks_has_a_code() -> None:
    assert [text for text in task_texts() if not codes_of(text)] == []


def test_every_note_of_our_own_norms_has_a_code() -> None:
    assert [note for note in notes() if not codes_of(note)] == []


def test_no_sentence_is_raised_where_it_is_written() -> None:
    """What is raised by a name is a Message or a code."""
    sentences = [where for where, _, code in coded_sites() if not CODE.fullmatch(code)]
    assert sentences == [], (
        "give each a code in estimators/messages/en.json and words in every app/language/*.json"
    )
    written = [where for where, call in sites() if isinstance(call.args[0], ast.JoinedStr)]
    assert [w.split(":")[0] for w in written] == []


def test_a_site_fills_in_every_value_of_its_english_words_and_no_other() -> None:
    def names(call: ast.Call) -> set[str] | None:
        match call.args:
            case [_, ast.Dict(keys=keys), *_]:
                return {key.value for key in keys if isinstance(key, ast.Constant)}  # type: ignore[misc]
            case [_] if all(keyword.arg for keyword in call.keywords):
                return {str(keyword.arg) for keyword in call.keywords}
        return None  # values by a name: the rooms' own tests read these

    assert [
        where
        for where, call, code in coded_sites()
        if (given := names(call)) is not None and given != gaps(english_texts()[code])
    ] == []


@pytest.mark.parametrize("other", OTHERS, ids=lambda one: one.code)
def test_every_language_has_every_code_with_the_same_values(other: Language) -> None:
    english = english_texts()
    assert other.messages.keys() == english.keys()
    worded = {c: text for c, text in english.items() if WORDS.search(GAP.sub("", str(text)))}
    assert [c for c, text in worded.items() if other.messages[c] == text] == [
        c for c in SAME.get(other.code, ()) if c in worded
    ]
    assert [c for c, text in english.items() if gaps(other.messages[c]) != gaps(text)] == []


def test_a_language_renders_an_error_by_its_code_with_numbers_in_its_form() -> None:
    large = InputError("motion_bids.zip_too_large", name="a.zip", size=6.25, most=4.0)
    assert str(large) == ENGLISH.translate(str(large))
    assert str(large).startswith("a.zip unpacks to 6.2 GB, more than 4 GB")
    assert GERMAN.translate(str(large)).startswith("a.zip wird entpackt 6,2 GB groß")
    assert GERMAN.translate(str(InputError("nothing has these words"))) == "nothing has these words"


@pytest.mark.parametrize(("count", "words"), [(0, "0 Messwerte;"), (1, "1 Messwert;")])
def test_counts_take_the_plural_form_of_the_language(count: int, words: str) -> None:
    message = Message("motion_bids.too_few_samples", {"name": "a.tsv", "count": count})
    assert words in GERMAN.render(message)
    assert ("1 sample;" in ENGLISH.render(message)) == (count == 1)


@pytest.mark.parametrize("other", OTHERS, ids=lambda one: one.code)
def test_every_error_is_said_by_its_code(
    other: Language,
) -> None:
    for code, text in english_texts().items():
        if code in SAME.get(other.code, ()) or not WORDS.search(GAP.sub("", str(text))):
            continue  # two values with a colon between
        message = Message(code, dict.fromkeys(gaps(text), 3))
        error = str(InputError(message))
        assert other.translate(error) == other.render(message) != error, code


def test_an_error_keeps_code_and_values_on_its_course_between_processes() -> None:
    error = InputError("motion_bids.not_utf8", name="a_channels.tsv")
    again = pickle.loads(pickle.dumps(error))
    assert (again.message, str(again)) == (error.message, str(error))


def test_the_docs_list_every_code() -> None:
    assert (ROOT / "docs/message-codes.md").read_text("utf-8") == table(), (
        "make it anew: python -m handscope.app.language.codes > docs/message-codes.md"
    )
