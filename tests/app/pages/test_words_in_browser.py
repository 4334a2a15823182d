"""What the words' gaps are filled with, in each language: numbers get its decimal mark, and what is no number stays as it is."""

from typing import Any

import pytest
from playwright.sync_api import Browser

from handscope.app.language import languages
from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
SAY = """async () => {
  const { decimal, plain, t } = await import("/static/words/words.js");
  const of = (version) => t("recording.firmware", { version });
  return { version: of("1.0"), number: of(1.5), decimal: decimal(1.25, 1), plain: plain(0.5) };
}"""


def said(browser: Browser, language: str) -> dict[str, Any]:
    context = browser.new_context(locale=language)
    page = context.new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    told: dict[str, Any] = page.evaluate(SAY)
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
