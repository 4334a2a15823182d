"""What the words' gaps are filled with, in each language: numbers get its decimal mark, and what is no number stays as it is."""

from typing import Any

import pytest
from playwright.sync_api import Browser

from handscope.app.language import ENGLISH, languages
from handscope.app.report import change_words, units
from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
SAY = """async () => {
  const { decimal, plain, t } = await import("/static/words/words.js");
  const of = (version) => t("recording.firmware", { version });
  return { version: of("1.0"), number: of(1.5), decimal: decimal(1.25, 1), plain: plain(0.5) };
}"""


TOGETHER = """async (texts) => {
  const { together } = await import("/static/words/joined.js");
  return texts.map(together);
}"""
ONE_LINE = {
    "en": ("3.14 per s", "Right hand: 62 mm wide, 9 of 10 done in 30 s"),
    "de": ("3,14 pro s", "Rechte Hand: 62 mm weit, 9 von 10 in 30 s"),
    "fr": ("3,14 par s", "Main droite : 62 mm, 9 sur 10 en 30 s"),
}


def said(browser: Browser, language: str, asked: str = SAY, given: Any = None) -> Any:
    context = browser.new_context(locale=language)
    page = context.new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    told: Any = page.evaluate(asked, given)
    context.close()
    return told


@pytest.mark.parametrize("language", languages())
def test_numbers_have_the_languages_decimal_mark_and_versions_keep_their_point(
    browser: Browser, language: str
) -> None:
    mark = "." if language == "en" else ","
    told = said(browser, language)
    assert told["version"].endswith(" 1.0")
    assert told["number"].endswith(f" 1{mark}5")
    assert (told["decimal"], told["plain"]) == (f"1{mark}3", f"0{mark}5")


@pytest.mark.parametrize("language", ONE_LINE)
def test_a_number_and_its_unit_stay_on_one_line_and_other_words_may_wrap(
    browser: Browser, language: str
) -> None:
    value, sentence = said(browser, language, TOGETHER, ONE_LINE[language])
    assert " " not in value and value.replace("\xa0", " ") == ONE_LINE[language][0]
    assert "62\xa0mm" in sentence and sentence.endswith("30\xa0s")
    assert sentence.count("\xa0") == 2


def test_a_deviation_stays_on_one_line_with_its_sign(browser: Browser) -> None:
    assert said(browser, "en", TOGETHER, ["± 0.001 per s"]) == ["±\xa00.001\xa0per\xa0s"]


def test_a_figures_sign_is_read_on_the_pages_as_in_the_report(browser: Browser) -> None:
    names = [f"a{part}b" for part in units.DIRECTIONS] + ["tapping_rate"]
    read = """async (names) => {
      const { directionsOf } = await import("/static/words/directions.js");
      return names.map(directionsOf);
    }"""
    assert said(browser, "en", read, names) == [[*units.directions_of(name)] for name in names]


def test_a_course_has_the_digits_of_the_report(browser: Browser) -> None:
    """The page gets a figure's decimals with its course; a count has none of them."""
    figures = [
        ("open_close_rate", 0.8, "per s"),
        ("tapping_interval_mean", 0.4283, "s"),
        ("open_close_fatigue10", 0.0124, "s"),
        ("tapping_decrement_slope", 0.0132, "mm"),
        ("tapping_amplitude_mean", 61.44, "mm"),
        ("tapping_opening_speed_mean", 534.4, "mm/s"),
        ("tapping_angle_closing_speed_mean", 146.4, "deg/s"),
        ("open_close_count", 6.0, ""),
        ("open_close_count", 6.5, ""),
        ("squeeze_force_mean", 1.234, "N"),
    ]
    read = """async (figures) => {
      const { changeWords } = await import("/static/progress/figure_words.js");
      const about = { hand: "left", against: "first" };
      const series = ([name, value, unit, decimals]) => ({ name, unit, decimals, joint: "", hands: { left: { points: [[0, 0, null, null], [1, value, null, null]] } } });
      return figures.map((figure) => changeWords(series(figure), about));
    }"""
    sizes = [change_words.amount(value, name, unit, ENGLISH) for name, value, unit in figures]
    sent = [[*figure, units.places_of(figure[0], units.BROKEN, figure[2])] for figure in figures]
    assert said(browser, "en", read, sent) == [f"{size} higher" for size in sizes]


CURVES = """async () => {
  const { curveWords } = await import("/static/words/clinical.js");
  return ["wrist_flexion", "index_pip_flexion", "aperture"].map(curveWords);
}"""


@pytest.mark.parametrize(
    ("language", "wrist", "index"),
    [
        ("en", "Wrist: flexion and extension", "Index PIP: flexion"),
        ("de", "Handgelenk: Beugung", "Zeigefinger PIP: Beugung"),
        ("fr", "Poignet\N{NO-BREAK SPACE}: flexion", "Index IPP\N{NO-BREAK SPACE}: flexion"),
    ],
)
def test_a_curve_of_a_joint_with_one_name_has_its_colon_behind_it(
    browser: Browser, language: str, wrist: str, index: str
) -> None:
    of_wrist, of_index, aperture = said(browser, language, CURVES)
    assert of_wrist.startswith(wrist) and of_index.startswith(index)
    assert "  " not in of_wrist + of_index and aperture


def test_a_value_says_its_direction_only_where_its_name_does_not(browser: Browser) -> None:
    read = """async (figures) => {
      const { labelWords, valueWords } = await import("/static/progress/figure_words.js");
      return figures.map(([joint, angle, end, value]) => `${labelWords({ joint, angle, end })}: ${valueWords({ joint, angle, end }, value)}`);
    }"""
    words = {
        ("wrist", "flexion", "smallest", -36.2): "Wrist, extension: 36°",
        ("wrist", "flexion", "smallest", 4.0): "Wrist, extension: 4° flexed",
        ("wrist", "flexion", "largest", 49.0): "Wrist, flexion: 49°",
        ("wrist", "deviation", "largest", 20.0): "Wrist, ulnar: 20°",
        ("wrist", "deviation", "largest", -3.0): "Wrist, ulnar: 3° radial",
        ("index_pip", "flexion", "largest", 84.0): "Index PIP, flexion: 84°",
        ("index_pip", "flexion", "smallest", 12.0): "Index PIP, extension: 12° flexed",
        ("index_pip", "flexion", "smallest", -5.0): "Index PIP, extension: 5° hyperext.",
    }
    assert said(browser, "en", read, list(map(list, words))) == list(words.values())
