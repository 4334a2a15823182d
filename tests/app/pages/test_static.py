"""Rules that the pages' files keep: small modules, every text in the languages' files, every colour in one file, nothing that the security policy forbids."""

import json
import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import pytest

from handscope import static
from handscope.app.language import ENGLISH, Language, languages

ROOT = Path(static.__file__).parent
MODULES = sorted(p for p in ROOT.rglob("*.js") if "vendor" not in p.parts)
STYLES = sorted(p for p in ROOT.rglob("*.css") if "vendor" not in p.parts)
DOCUMENTS = sorted(ROOT.rglob("*.html"))
GAP = re.compile(r"\{(\w+)\}")
PARTS = [
    p
    for p in MODULES
    if p.parent.name in ("pages", "patient", "session", "station", "login", "patient_view")
]
NOT_MOUNTED = {
    "replay_focus.js",
    "repetitions.js",
    "folded.js",
    "confirmation.js",
    "coming.js",
    "passkey.js",
    "going_on.js",
    "hand_drawing.js",
    "hand_map.js",
    "stored_calibrations.js",
    "lengths.js",
    "merging.js",
    "fact_fields.js",
    "record.js",
    "ward_names.js",
    "landmarks.js",
    "prefetch.js",
    "photograph_figures.js",
    "connection.js",
    "words.js",
    "metronome_time.js",
    "clicks.js",
    "cue_tones.js",
    "following.js",
    "patient_view.js",
    "joint_rows.js",
    "saving.js",
    "phone_folds.js",
}  # values that parts share
NAMES = "../../languages/names.js"  # which the server writes
SVG = "http://www.w3.org/2000/svg"  # the name of its namespace; nothing is loaded from there
COLOUR = re.compile(r"#[0-9a-fA-F]{3,8}\b|\b(?:rgba?|hsla?|oklch)\(")


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_a_module_is_short_and_says_what_it_is(path: Path) -> None:
    lines = path.read_text("utf-8").splitlines()
    assert len(lines) < 150
    assert lines[0].startswith("/** ")
    assert max(map(len, lines)) <= 140


@pytest.mark.parametrize("path", PARTS, ids=name)
def test_a_part_of_a_page_can_be_mounted(path: Path) -> None:
    assert path.name in NOT_MOUNTED or "export function mount(root" in path.read_text("utf-8")


@pytest.mark.parametrize(
    "path", [p for p in (*STYLES, *MODULES, *DOCUMENTS) if p.name != "colors.css"], ids=name
)
def test_colours_stand_in_one_file(path: Path) -> None:
    assert COLOUR.findall(path.read_text("utf-8")) == []


def test_every_colour_that_is_used_is_defined_for_light_and_for_dark() -> None:
    light, dark = (
        set(re.findall(r"(--[\w-]+):", part))
        for part in (ROOT / "colors.css").read_text("utf-8").split("@media")
    )
    used = {
        c
        for path in (*STYLES, *MODULES)
        for c in re.findall(r"var\((--[\w-]+)\)|\"(--[\w-]+)\"", path.read_text("utf-8"))
        for c in c
        if c
    }
    tokens = set(re.findall(r"(--[\w-]+):", (ROOT / "style.css").read_text("utf-8")))
    assert used - light - tokens == set()
    assert light - dark <= {"--accent-strong"} - dark


def test_every_icon_that_is_used_has_a_picture() -> None:
    """Without one a filled square is drawn."""
    used = {n for p in MODULES for n in re.findall(r'\bicon\("([\w-]+)"\)', p.read_text("utf-8"))}
    drawn = {n for p in STYLES for n in re.findall(r"\.icon-([\w-]+) \{", p.read_text("utf-8"))}
    assert used - drawn == set()
    assert [n for n in sorted(drawn) if not (ROOT / f"vendor/lucide/{n}.svg").is_file()] == []


@pytest.mark.parametrize("path", DOCUMENTS, ids=name)
def test_documents_hold_nothing_that_the_security_policy_forbids(path: Path) -> None:
    text = path.read_text("utf-8")
    assert "style=" not in text and "<style" not in text and not re.search(r"\son\w+=", text)
    assert re.findall(r"<script(?![^>]*\ssrc=)", text) == []
    assert all(
        address.startswith(("/static/", "/languages/"))
        for address in re.findall(r"(?:src|href)=\"([^\"]+)\"", text)
    )


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_modules_make_no_markup_from_text_and_load_nothing_from_elsewhere(path: Path) -> None:
    text = path.read_text("utf-8")
    assert not re.search(
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function", text
    )
    assert "http://" not in text.replace(SVG, "") and "https://" not in text


@pytest.mark.parametrize("folder", ["login", "patient_view"])
def test_a_page_without_a_login_needs_only_what_is_served_without_one(folder: str) -> None:
    from handscope.app.auth.gate import OPEN_FILES, OPEN_FOLDERS

    page = ROOT / folder
    needed = re.findall(r"(?:src|href)=\"([^\"]+)\"", (page / "index.html").read_text("utf-8"))
    modules, k = [page / f"{folder}.js"], 0
    while k < len(modules):  # and what they import in their turn
        text = modules[k].read_text("utf-8")
        found = [
            (modules[k].parent / n).resolve()
            for n in re.findall(r"(?:from|import\(|import) ?\"(\.[^\"]+)\"", text)
            if n != NAMES
        ]
        modules, k = [*modules, *(m for m in found if m not in modules)], k + 1
    needed += [f"/static/{m.relative_to(ROOT).as_posix()}" for m in modules]
    assert [n for n in needed if n not in OPEN_FILES and not n.startswith(OPEN_FOLDERS)] == []
    assert len(needed) > 4


def test_every_address_between_the_files_leads_somewhere() -> None:
    for path in MODULES:
        for target in re.findall(r"(?:from|import\()\s*\"(\.[^\"]+)\"", path.read_text("utf-8")):
            if target == NAMES:
                continue
            assert (path.parent / target).resolve().is_file(), f"{name(path)} imports {target}"
    for path in DOCUMENTS:
        for target in re.findall(r"(?:src|href)=\"/static/([^\"]+)\"", path.read_text("utf-8")):
            assert (ROOT / target).is_file(), f"{name(path)} names {target}"


def _used() -> Iterator[tuple[str, str]]:
    """Keys named in the modules, as regular expressions: `hand.${side}` is hand\\.[^.]+ (a part may hold dots itself)."""
    for path in MODULES:
        if path.parent.name == "words" and path.name not in ("clinical.js", "joined.js"):
            continue
        text = path.read_text("utf-8")
        for key in re.findall(r"\b(?:t|known)\(\s*(?:\"([\w.]+)\"|`([^`]+)`)", text):
            yield name(path), _pattern(key[0] or key[1])
        for key in re.findall(r"counted\(\"([\w.]+)\"", text):
            yield from ((name(path), re.escape(f"{key}.{end}")) for end in ("one", "other"))
        for key in re.findall(r"[\"`]([a-z_]+(?:\.[\w${}]+)+)[\"`]", text):
            yield name(path), _pattern(key) + r"(\.(one|other))?"  # what counts has forms


def _pattern(key: str) -> str:
    return "[\\\\w.]+".join(
        re.escape(piece) for piece in re.sub(r"\$\{(?:[^{}]|\{[^}]*\})*\}", "\0", key).split("\0")
    ).replace("\\\\w", "\\w")


def test_every_text_that_is_used_is_in_the_dictionary_and_none_is_left_over() -> None:
    words = ENGLISH.pages
    used = set(_used())
    assert len(used) > 200
    lacking = [
        (where, key) for where, key in used if not any(re.fullmatch(key, word) for word in words)
    ]
    # `known` has another word at hand where a key is missing; what ends in an extension names a file
    assert [
        k
        for k in lacking
        if not re.search(r"\.(js|css|svg|zip|csv|json|pdf)(\(|$)", k[1].replace("\\", ""))
    ] == []
    patterns = [re.compile(key) for _, key in used]
    assert [word for word in words if not any(p.fullmatch(word) for p in patterns)] == []


@pytest.mark.parametrize(
    "other", [one for one in languages().values() if one is not ENGLISH], ids=lambda one: one.code
)
def test_every_language_has_every_text_of_the_pages_with_the_same_gaps(other: Language) -> None:
    own = json.loads(
        files("handscope.app.language").joinpath(f"{other.code}.json").read_text("utf-8")
    )["pages"]
    forms = {key for key in own if key.rpartition(".")[0] + ".other" in ENGLISH.pages}
    assert [key for key in own if key not in ENGLISH.pages and key not in forms] == []
    assert [key for key in ENGLISH.pages if key not in own] == []
    assert [
        key
        for key in ENGLISH.pages
        if sorted(GAP.findall(own[key])) != sorted(GAP.findall(ENGLISH.pages[key]))
    ] == []


def test_words_stand_in_no_module() -> None:
    assert [p.name for p in MODULES if p.parent.name == "words" and len(p.stem) == 2] == [], (
        "words belong into app/language/*.json, pages"
    )


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_a_label_takes_its_colon_from_the_language(path: Path) -> None:
    """French has a space before it: words/joined.js `labelled`."""
    assert re.findall(r"\$\{[^}]*\}: ?`", path.read_text("utf-8")) == []


def test_a_heading_stays_one_for_a_screen_reader() -> None:
    """A role of its own would take it out of the list of headings."""
    with_role = re.compile(r'h\("h[1-6]", \{[^}]*\brole:')
    assert [p.name for p in MODULES if with_role.search(p.read_text("utf-8"))] == []
