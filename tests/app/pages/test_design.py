"""The rules of docs/design.md: five sizes, one unit of space, one set of icons, and contrast in light and in dark."""

import re
from pathlib import Path

import pytest

from handscope import static

ROOT = Path(static.__file__).parent
STYLES = sorted(p for p in ROOT.rglob("*.css") if "vendor" not in p.parts)
MODULES = sorted(p for p in ROOT.rglob("*.js") if "vendor" not in p.parts)
GROUNDS = ("--surface", "--ground", "--surface-sunk")
TEXT = 4.5  # WCAG 2.2, 1.4.3; labels on a canvas are --ink-soft (static/plots/plot.js)
DRAWN = 3.0  # 1.4.11
PAIRS = [
    *[(ink, ground, TEXT) for ink in ("--ink", "--ink-soft") for ground in GROUNDS],
    *[(f"--{kind}", f"--{kind}-soft", TEXT) for kind in ("accent", "good", "warn", "bad")],
    *[("--accent", ground, TEXT) for ground in GROUNDS],
    ("--on-accent", "--accent", TEXT),
    ("--on-accent", "--accent-strong", TEXT),
    ("--on-bad", "--bad-strong", TEXT),
    *[(f"--curve-{name}", "--surface", DRAWN) for name in ("1", "2", "3", "4", "mark")],
    ("--edge", "--surface", DRAWN),
]


def colours(theme: str) -> dict[str, str]:
    """Names and values of colors.css in one theme."""
    light, dark = (
        dict(re.findall(r"(--[\w-]+): (#[0-9a-f]{6})", part))
        for part in (ROOT / "colors.css").read_text("utf-8").split("@media")
    )
    return light if theme == "light" else light | dark


def luminance(colour: str) -> float:
    """Relative luminance of #rrggbb (WCAG 2.2)."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return sum(share * c for share, c in zip((0.2126, 0.7152, 0.0722), linear))


def contrast(one: str, other: str) -> float:
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def test_black_on_white_has_the_contrast_that_wcag_says() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_texts_labels_on_a_canvas_and_curves_have_enough_contrast(theme: str) -> None:
    of = colours(theme)
    found = {(a, b): round(contrast(of[a], of[b]), 2) for a, b, _ in PAIRS}
    assert [(a, b, found[a, b]) for a, b, least in PAIRS if found[a, b] < least] == []


def test_labels_on_a_canvas_are_drawn_in_the_colour_that_is_measured() -> None:
    texts = {p.name: p.read_text("utf-8") for p in MODULES}
    drawing = [name for name, text in texts.items() if "fillText(" in text]
    assert drawing != []
    assert [name for name in drawing if '"--ink-soft"' not in texts[name]] == []


def test_a_placeholder_has_the_colour_that_is_measured_on_every_page() -> None:
    assert "::placeholder { color: var(--ink-soft); opacity: 1; }" in (
        ROOT / "style.css"
    ).read_text("utf-8")


@pytest.mark.parametrize("path", STYLES, ids=lambda path: path.name)
def test_type_has_five_sizes_and_space_one_unit(path: Path) -> None:
    text = path.read_text("utf-8")
    sizes = re.findall(r"font-size: ([^;}]+)", text)
    allowed = r"var\(--size-[1-5]\)|0|calc\(3 \* var\(--size-5\)\)"
    assert [size for size in sizes if not re.fullmatch(allowed, size.strip())] == []
    spaces = re.findall(r"(?<![\w-])(?:margin|padding|gap)[\w-]*: ([^;}]+)", text)
    lengths = [float(n) for space in spaces for n in re.findall(r"([\d.]+)rem", space)]
    assert [n for n in lengths if (4 * n) % 1] == []


def test_icons_are_of_the_bundled_set_and_none_is_left_over() -> None:
    style = (ROOT / "style.css").read_text("utf-8")
    files = {p.stem for p in (ROOT / "vendor" / "lucide").glob("*.svg")}
    assert set(re.findall(r"lucide/([\w-]+)\.svg", style)) == files
    named = {n for p in MODULES for n in re.findall(r"icon\(\"([\w-]+)\"", p.read_text("utf-8"))}
    assert named - files == set()
    glyphs = re.compile("[\u2190-\u21ff\u25a0-\u2bff\u2039\u203a]")
    assert [p.name for p in (*MODULES, *STYLES) if glyphs.search(p.read_text("utf-8"))] == []
