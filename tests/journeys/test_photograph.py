"""The pose sheet and a photograph of the hand on it: landmarks proposed, moved, measured, lengths taken over."""

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.journeys.house import api, keep_picture, shown

pytestmark = pytest.mark.browser
pytest.importorskip("cv2")

from handscope.validation.studies.rendered_photographs import render  # noqa: E402


def test_a_photograph_gives_lengths_and_angles(page: Page, patient: int, tmp_path: Path) -> None:
    made = render(np.random.default_rng(8), "left", "a4", np.radians(12))
    picture = tmp_path / "hand.jpg"
    picture.write_bytes(made.jpeg)
    page.get_by_text("Pose sheet and photograph").click()
    sheet = page.get_by_role("link", name="Sheet, A4")
    assert page.request.get(str(sheet.get_attribute("href"))).body().startswith(b"%PDF")
    begin = page.get_by_role("button", name="Find the landmarks")
    begin.click()
    expect(page.get_by_text("Choose a photograph first.")).to_be_visible()
    page.locator('input[name="photograph"]').set_input_files(picture)
    begin.click()
    drawing = shown(page.locator("svg.landmarks"))
    for name, (x, y) in made.marks.items():
        page.locator(f'[data-landmark="{name}"]').evaluate(
            "(dot, at) => { const key = (k) => dot.dispatchEvent(new KeyboardEvent('keydown', { key: k, bubbles: true }));"
            " const go = (now, to, less, more) => { for (let k = Math.round(to - now); k; k += k < 0 ? 1 : -1) key(k < 0 ? less : more); };"
            " go(+dot.getAttribute('cx'), at[0], 'ArrowLeft', 'ArrowRight');"
            " go(+dot.getAttribute('cy'), at[1], 'ArrowUp', 'ArrowDown'); }",
            [x, y],
        )
    keep_picture(page, "photograph-landmarks")
    tip = page.locator('[data-landmark="index_tip"]')
    before = tip.get_attribute("cx")
    box = tip.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 2, box["y"] + box["height"] / 2)
    page.mouse.up()
    assert tip.get_attribute("cx") != before
    page.get_by_role("button", name="Measure", exact=True).click()
    expect(drawing).to_be_hidden()
    shown(page.locator("summary", has_text="Left hand,")).click()
    expect(page.get_by_role("cell", name="°").first).to_be_visible()
    keep_picture(page, "photograph-figures")
    page.get_by_role("button", name="Take the lengths over").click()
    expect(page.get_by_text("The lengths are in the hand measures.")).to_be_visible()
    stored = api(page, f"/api/patients/{patient}")["hand_measures"]["left"]
    assert abs(stored["palm_length"] - made.geometry.palm_length) < 3e-3
    page.get_by_role("button", name="Erase it").click()
    expect(page.locator("summary", has_text="Left hand,")).to_be_hidden()
