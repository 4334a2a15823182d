"""Film a session with the virtual glove in a real browser: `PYTHONPATH=. python docs/images/moving_picture.py` writes session.webp (needs the packages of `dev`)."""

import io
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from playwright.sync_api import Locator, Page, sync_playwright

from tests.browser import chromium

TARGET = Path(__file__).with_name("session.webp")
VIEW = {"width": 1200, "height": 800}
SHOWN = (900, 600)  # pixels of the film
STEP = 250  # ms between two pictures while the hand moves
QUALITY = 62
MOST_BYTES = 3_000_000
SELDOM = """
  const draws = window.requestAnimationFrame, drops = window.cancelAnimationFrame;
  const there = () => location.pathname.startsWith("/scene/") && window.__viserSceneTree?.getState()["/hand/palm"] !== undefined;
  window.requestAnimationFrame = (draw) => (there() ? -setTimeout(() => draws(draw), 800) : draws(draw));
  window.cancelAnimationFrame = (drawing) => (drawing < 0 ? clearTimeout(-drawing) : drops(drawing));
"""  # drawn in software at full speed, the scene takes both cores, and the recording loses samples


class Film:
    """Pictures of a page, each with how long it is shown."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.frames: list[Image.Image] = []
        self.shown: list[int] = []  # ms

    def take(self, shown: int) -> None:
        """One picture of what the page shows now."""
        picture = Image.open(io.BytesIO(self.page.screenshot()))
        self.frames.append(picture.convert("RGB").resize(SHOWN, Image.Resampling.LANCZOS))
        self.shown.append(shown)

    def follow(self, until: Locator, most: int) -> None:
        """Pictures while something moves, until `until` is there, at most so many."""
        for _ in range(most):
            if until.count() and until.first.is_visible():
                return
            self.take(STEP)
            self.page.wait_for_timeout(STEP)

    def save(self, path: Path) -> int:
        """Write the film; its bytes."""
        first, *others = self.frames
        first.save(
            path,
            save_all=True,
            append_images=others,
            duration=self.shown,
            loop=0,
            quality=QUALITY,
            method=6,
        )
        return path.stat().st_size


@contextmanager
def demo(data: Path) -> Iterator[str]:
    """The address that lets into a demonstration server; the simulated patients are not made beside it, which would take the film a core."""
    words = ["demo", "--no-browser", "--no-examples", "--port", "0", "--data", str(data)]
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "handscope.app.cli", *words],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        line = next(line for line in process.stdout if "/login?token=" in line)
        try:
            yield line.split()[-1]
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(60)


def session(page: Page, film: Film) -> None:
    """From a new session to its results."""

    def act(name: str) -> Locator:
        return page.locator(f'[data-act="{name}"]')

    page.get_by_role("link", name="DEMO").first.click()
    page.get_by_role("button", name="Start session").wait_for()
    page.locator('input[name="hand"][value="left"]').check()
    page.get_by_role("radio", name="Virtual left glove").check()
    film.take(1500)
    page.get_by_role("button", name="Start session").click()
    act("continue").wait_for()
    page.wait_for_timeout(6000)
    film.take(1500)
    act("continue").click()
    act("start").wait_for()
    film.take(1200)
    act("start").click()
    film.follow(act("accept"), 20)
    film.take(1500)
    act("accept").click()
    for task in ("rom_fist", "tapping"):
        page.locator(f'[data-task="{task}"]').click()
        film.take(1000)
        act("start").click()
        film.follow(act("accept"), 45)
        film.take(1500)
        act("accept").click()
    act("finish").click()
    page.get_by_role("button", name="Yes, finish").click()
    page.wait_for_url("**/sessions/*")
    page.get_by_role("heading", name="Range of motion").wait_for()
    page.wait_for_timeout(1500)
    film.take(2500)
    page.mouse.wheel(0, 600)
    page.wait_for_timeout(500)
    film.take(2500)


def main() -> None:
    """Film it, and say how large the film became."""
    with tempfile.TemporaryDirectory() as data, demo(Path(data)) as address, sync_playwright() as t:
        browser = t.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
        page = browser.new_context(viewport=VIEW).new_page()  # type: ignore[arg-type]
        page.set_default_timeout(180_000)
        page.add_init_script(SELDOM)
        page.goto(address)
        film = Film(page)
        session(page, film)
        browser.close()
    size = film.save(TARGET)
    sys.stdout.write(f"{TARGET.name}: {len(film.frames)} pictures, {size / 1e6:.1f} MB\n")
    if size > MOST_BYTES:
        sys.exit("larger than 3 MB: lower QUALITY")


if __name__ == "__main__":
    main()
