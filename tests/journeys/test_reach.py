"""Reaching with a magnet on the hand: led through the task, the hand's place shown meanwhile, figures in metres on the session page and in the report."""

import io
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page
from pypdf import PdfReader

from handscope.validation.benchmarks.server_under_test import glove, wait_for
from tests.journeys.house import (
    LONG,
    Server,
    act,
    api,
    figure,
    keep_picture,
    name_port,
    new_patient,
    shown,
)
from tests.journeys.test_accessibility import looked_at

pytestmark = [pytest.mark.browser, pytest.mark.slow]
TWICE_OUT = 10.0  # s of the task's samples: out, back, and out again, 3 s each
IN_METRES = (  # rows of the reach that only a magnet gives
    "Distance reached",
    "Way of the hand",
    "Way over straight distance",
    "Smoothness of the hand's way, SPARC",
    "Lean of the trunk",
    "Turn of the trunk",
    "Trunk carried forward",
    "Space these reaches passed through",
)


@pytest.fixture
def with_a_magnet(tmp_path: Path) -> Iterator[Path]:
    """A virtual glove with a plate of magnetometers on the trunk and a magnet on the hand."""
    port = tmp_path / "glove"
    with glove(port, "--hand", "left", "--strips", "thumb,index,trunk", "--rate", "50"):
        yield port


def test_a_reach_is_led_through_and_told_in_metres(
    another_page: Callable[..., Page], server: Server, with_a_magnet: Path
) -> None:
    page = another_page(scene=False, at=None, bypass_csp=True)
    name_port(page, f"{server.base}/patients/{new_patient(page)}", with_a_magnet)
    page.get_by_role("button", name="Start session").click()
    page.wait_for_url("**/stations/*")
    shown(act(page, "continue")).click()
    shown(act(page, "start")).click()
    shown(act(page, "accept")).click()
    shown(page.get_by_label("Which tasks?")).select_option("reach")
    shown(page.locator('[data-task="reach"]')).click()
    shown(act(page, "start"))
    shown(page.get_by_text("Distance from the trunk"))
    keep_picture(page, "reach-ready")
    looked_at(page, "reach, ready")
    act(page, "start").click()
    shown(page.get_by_text("Seconds left"))
    station = f"/api/stations/{page.url.rsplit('/', 1)[1]}"
    wait_for(lambda: (api(page, station)["wizard"]["pace"]["elapsed"] or 0.0) > TWICE_OUT)
    keep_picture(page, "reach-running")
    act(page, "stop").click()
    shown(act(page, "accept")).click()
    shown(act(page, "finish")).click()  # nothing is left undone: no question
    page.wait_for_url("**/sessions/*")
    _read(page)


def _read(page: Page) -> None:
    shown(page.get_by_role("heading", name="Reach", exact=True), 2 * LONG)
    told = {name: figure(page, name) for name in IN_METRES}
    judged = ("Distance reached", "Lean of the trunk", "Trunk carried forward")
    assert all("±" in told[name] for name in judged), told  # below the last digit it is left out
    distance, lean, forward = (float(told[name].split(" ")[0]) for name in judged)
    assert (
        abs(distance - 250) < 60
    )  # mm, against the trunk, of a person who reaches 280 mm and leans by 0.3 rad a metre
    assert abs(lean - 5) < 3
    assert abs(forward - 34) < 20
    keep_picture(page, "session-reach")
    looked_at(page, "session, reach")
    link = page.get_by_role("link", name="Report (PDF)").get_attribute("href")
    pdf = page.request.get(f"{page.url.split('/sessions')[0]}{link}").body()
    words = " ".join("".join(p.extract_text() for p in PdfReader(io.BytesIO(pdf)).pages).split())
    assert [name for name in IN_METRES if name not in words] == []
    assert told["Trunk carried forward"] in words
    _height_corrected(page, told["Trunk carried forward"])


def _height_corrected(page: Page, before: str) -> None:
    """From an address that names a result, as after a choice among several: what is computed anew is looked at without a reload."""
    address = page.url
    named = api(page, f"/api/sessions/{address.rsplit('/', 1)[1]}")["recordings"][0]["results"][0][
        "id"
    ]
    page.goto(f"{address}?result={named}")
    shown(page.get_by_text("Correct the height…")).click()
    page.get_by_label("Trunk sensor above the hips").fill("600")
    page.get_by_role("button", name="Correct the height", exact=True).click()
    row = page.get_by_role("row").filter(
        has=page.get_by_role("rowheader", name="Trunk carried forward", exact=True)
    )
    shown(row.filter(has_not_text=before))
