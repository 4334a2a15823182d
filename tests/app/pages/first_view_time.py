"""How long a browser on a slow network waits: for the largest text of the patients' list, for the hand of a station's 3-D scene; and how far the list moves meanwhile.

Chromium, slowed by its own tools to a network's rate and round trip. The scene is opened by its station's address with nothing kept, once more, and as a clinician does with nothing kept: from the list to the
patient's page, FILLING seconds in the form there, and the press that begins the session, from which is counted. Chromium's tools do not slow web sockets, on which the hand itself comes: `whole line` is the
same on a line that is slow for everything (slow_line.py). What the scene draws is dropped: a machine without a graphics processor would draw its first pictures for seconds.
Run     python -m tests.app.pages.first_view_time
Limits  this machine's processor, which server and glove share, not a tablet's
"""

import statistics
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Browser, Frame, Page, sync_playwright

from handscope.app.auth.gate import new_token
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.server_under_test import Client, begin_tasks, glove, server
from tests.app.scene.drawing_calls import COUNTED
from tests.app.slow_line import slow_line
from tests.browser import KEPT_APART, chromium

SIZE = {"width": 1024, "height": 768}
NETWORKS = {"10 Mbit/s, 40 ms": (10e6, 40), "1.6 Mbit/s, 150 ms": (1.6e6, 150)}
TEXT, SCENE, SHIFT = 1.0, 3.0, 0.01  # s, s, share of the page; wanted on the first of them
RUNS = 5
FILLING = 5.0  # s
PATIENT = "slow"
SHIFTED = """
  window.shifted = 0;
  new PerformanceObserver((seen) => seen.getEntries().forEach((one) => (shifted += one.value)))
    .observe({ type: "layout-shift", buffered: true });
"""
LARGEST = """() => new Promise((found) =>
  new PerformanceObserver((seen) => found(seen.getEntries().at(-1).startTime / 1e3))
    .observe({ type: "largest-contentful-paint", buffered: true }))"""
NOW = "() => performance.now() / 1e3"
HAND_STANDS = "() => window.__viserSceneTree?.getState()['/hand/palm'] !== undefined"
HAND = f"{HAND_STANDS} && window.counted.rendered > 0"


def measure() -> list[Metric]:
    """Median and largest of RUNS."""
    with tempfile.TemporaryDirectory() as folder:
        port, free, data = (Path(folder) / name for name in ("glove", "free", "data"))
        with glove(port), glove(free), server(data) as (address, _), sync_playwright() as tool:
            client = Client(address)
            station = begin_tasks(client, port)
            client.call("POST", "/api/patients", {"pseudonym": PATIENT})
            one = tool.chromium.launch(
                executable_path=chromium(), args=["--no-sandbox", KEPT_APART]
            )
            found = list[Metric]()
            for name, (rate, latency) in NETWORKS.items():
                found += _on_network(one, client.base, data, station, free, name)
                with slow_line(int(client.base.rsplit(":", 1)[1]), rate, latency / 1e3) as line:
                    base = f"http://127.0.0.1:{line}"
                    found += _on_whole_line(one, base, data, station, free, name)
            one.close()
            client.call("DELETE", f"/api/stations/{station}")
    return found


def _on_network(
    one: Browser, base: str, data: Path, station: str, free: Path, name: str
) -> list[Metric]:
    texts, shifts, scenes, again, after_form = [], [], [], [], []
    for _ in range(RUNS):
        page = _slow(_open_page(one, base, data), name)
        page.goto(base, wait_until="networkidle")
        texts.append(page.evaluate(LARGEST))
        shifts.append(page.evaluate("() => window.shifted"))
        page.context.close()
        page = _slow(_open_page(one, base, data), name)
        scenes.append(_time_of_hand(page, f"{base}/stations/{station}"))
        again.append(_time_of_hand(page, f"{base}/stations/{station}"))
        page.context.close()
        after_form.append(_time_after_form(_slow(_open_page(one, base, data), name), base, free))
    text, scene = (TEXT, SCENE) if name == next(iter(NETWORKS)) else (None, None)
    return [
        Metric(f"{name}: largest text, median", statistics.median(texts), "s", text, "lower"),
        Metric(f"{name}: the same, longest of {RUNS}", max(texts), "s", None, "lower"),
        Metric(f"{name}: layout shift", max(shifts), "1", SHIFT, "lower"),
        Metric(
            f"{name}: hand in the scene, median", statistics.median(scenes), "s", scene, "lower"
        ),
        Metric(f"{name}: the same, longest of {RUNS}", max(scenes), "s", None, "lower"),
        Metric(f"{name}: with files kept, median", statistics.median(again), "s", scene, "lower"),
        Metric(
            f"{name}: after the form, median", statistics.median(after_form), "s", scene, "lower"
        ),
        Metric(f"{name}: the same, longest of {RUNS}", max(after_form), "s", None, "lower"),
    ]


def _on_whole_line(
    one: Browser, base: str, data: Path, station: str, free: Path, name: str
) -> list[Metric]:
    scenes, after_form = [], []
    for _ in range(RUNS):
        page = _open_page(one, base, data)
        scenes.append(_time_of_hand(page, f"{base}/stations/{station}"))
        page.context.close()
        after_form.append(_time_after_form(_open_page(one, base, data), base, free))
    return [
        Metric(f"{name}, whole line: {what}, median", statistics.median(times), "s", None, "lower")
        for what, times in (("hand in the scene", scenes), ("after the form", after_form))
    ]


def _time_of_hand(page: Page, address: str) -> float:
    """s from the request of a station's document."""
    page.goto(address, wait_until="commit")
    _scene_of(page).wait_for_function(HAND, timeout=60_000)
    return float(page.evaluate(NOW))


def _time_after_form(page: Page, base: str, port: Path) -> float:
    """s from the press that begins a session; the session and the page are ended."""
    page.goto(base, wait_until="networkidle")
    page.get_by_role("link", name=PATIENT, exact=True).click()
    page.locator('input[name="hand"][value="left"]').check()
    page.get_by_role("radio", name="Another port").check()
    page.get_by_label("Port", exact=True).fill(str(port))
    page.wait_for_timeout(FILLING * 1e3)
    begun = float(page.evaluate(NOW))
    page.get_by_role("button", name="Start session").click()
    page.wait_for_url("**/stations/*")
    _scene_of(page).wait_for_function(HAND, timeout=60_000)
    taken = float(page.evaluate(NOW)) - begun
    page.request.delete(f"{base}/api/stations/{page.url.rsplit('/', 1)[1]}")
    page.context.close()
    return taken


def _scene_of(page: Page) -> Frame:
    frame = page.wait_for_selector(".scene iframe").content_frame()  # type: ignore[union-attr]
    assert frame is not None
    return frame


def _open_page(one: Browser, base: str, data: Path) -> Page:
    """A page of a new profile, logged in."""
    context = one.new_context(viewport=SIZE)  # type: ignore[arg-type]
    context.request.post(f"{base}/api/login", data={"token": new_token(data)})
    context.add_init_script(SHIFTED)
    context.add_init_script(COUNTED + "counted.drop = true;")
    return context.new_page()


def _slow(page: Page, network: str) -> Page:
    """The page, slowed by Chromium's own tools."""
    rate, latency = NETWORKS[network]
    devtools = page.context.new_cdp_session(page)
    devtools.send("Network.enable")
    devtools.send(
        "Network.emulateNetworkConditions",
        {
            "offline": False,
            "latency": latency,
            "downloadThroughput": rate / 8,
            "uploadThroughput": rate / 8,
        },
    )
    return page


if __name__ == "__main__":
    for metric in measure():
        sys.stdout.write(f"{metric.name:60} {metric.value:8.3g} {metric.unit}\n")
