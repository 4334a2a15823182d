"""Take the right halves of design.md's pictures anew: `PYTHONPATH=. python docs/images/design_pictures.py` (needs the packages of `dev`).

The left halves are the first edition's pages; they stay as they are.
"""

import io
import tempfile
from pathlib import Path

from moving_picture import demo
from PIL import Image
from playwright.sync_api import Page, sync_playwright
from results_picture import make

from handscope.app.example_patients.stories import STORIES
from tests.browser import chromium

HERE = Path(__file__).parent
STORY = next(story for story in STORIES if "Parkinson" in story.code)  # who taps
WIDE, PHONE = (1440, 900), (390, 844)
HALVES = {
    "session": (705, 695, WIDE),
    "patient": (705, 695, WIDE),
    "phone": (410, 390, PHONE),
}  # px: where it begins, its width


def take(page: Page, name: str) -> None:
    """Put the page as it stands into the right half of a picture."""
    left, width, (wide, high) = HALVES[name]
    page.set_viewport_size({"width": wide, "height": high})
    page.wait_for_load_state("networkidle")
    page.wait_for_timeout(500)
    path = HERE / f"design-{name}.png"
    both = Image.open(path).convert("RGB")
    now = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    both.paste(now.resize((width, both.height), Image.Resampling.LANCZOS), (left, 0))
    both.quantize(256).save(path, optimize=True)


def main() -> None:
    """The patient's page, and the newest session on a screen and on a phone."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder)
        make(data, STORY)
        with demo(data) as address, sync_playwright() as tool:
            browser = tool.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
            page = browser.new_page()
            page.set_default_timeout(180_000)
            page.goto(address)
            page.get_by_role("link", name=STORY.code).first.click()
            page.get_by_role("heading", name="Progress").wait_for()
            take(page, "patient")
            page.locator('a[href^="/sessions/"]').first.click()
            page.get_by_role("heading", name="Can I trust these numbers?").wait_for()
            take(page, "session")
            take(page, "phone")
            browser.close()


if __name__ == "__main__":
    main()
