"""The report as HTML in a browser: tables have the page's width."""

import pytest
from playwright.sync_api import Browser

from handscope.app.language import language
from handscope.app.report import FORMS, Style
from tests.app.report.simulated_sessions import report

pytestmark = pytest.mark.browser
WIDTHS = """() => [...document.querySelectorAll(".wide")].map((one) => [
  one.querySelector("table")?.getBoundingClientRect().width / one.closest("section").getBoundingClientRect().width, one.scrollWidth - one.clientWidth])"""


@pytest.mark.parametrize("code", ["en", "de", "fr"])
def test_a_wide_table_stands_below_its_heading_and_not_beside_its_task(
    browser: Browser, code: str
) -> None:
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    page.set_content(FORMS["html"](report(), Style(language(code))).decode())
    found = page.evaluate(WIDTHS)
    page.close()
    assert found and all(share > 0.99 and beyond == 0 for share, beyond in found)
