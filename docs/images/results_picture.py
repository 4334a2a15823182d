"""Take a picture of a session's results in a real browser: `PYTHONPATH=. python docs/images/results_picture.py` writes results.png (needs the packages of `dev`)."""

import tempfile
from dataclasses import replace
from pathlib import Path

from moving_picture import demo
from playwright.sync_api import sync_playwright

from handscope.app.example_patients import patients, sessions
from handscope.app.example_patients.stories import STORIES, Story
from handscope.sessions.store.store import open_store
from tests.browser import chromium

TARGET = Path(__file__).with_name("results.png")
VIEW = {"width": 1440, "height": 900}
VISITS = 3  # of a simulated patient's course; the other hand of the first one follows in the first


def make(data: Path, story: Story) -> None:
    """The first sessions of the simulated patient of one story."""
    store = open_store(data)
    patients.add_patients(store)
    sessions.STORIES = (replace(story, course=story.course[:VISITS]),)
    sessions.add_sessions(store)
    store.close()


def main() -> None:
    """The newest of them, as its page opens."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder)
        make(data, STORIES[0])
        with demo(data) as address, sync_playwright() as tool:
            browser = tool.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
            page = browser.new_context(viewport=VIEW).new_page()  # type: ignore[arg-type]
            page.set_default_timeout(180_000)
            page.goto(address)
            page.get_by_role("link", name=STORIES[0].code).first.click()
            page.locator('a[href^="/sessions/"]').first.click()
            page.get_by_role("heading", name="Can I trust these numbers?").wait_for()
            page.wait_for_load_state("networkidle")
            page.mouse.move(0, 0)  # away from the joints, which it would mark
            page.screenshot(path=TARGET)
            browser.close()


if __name__ == "__main__":
    main()
