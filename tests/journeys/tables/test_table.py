"""A table of a logger that nobody knows: uploaded, mapped by a person, and assessed; what its numbers contradict is said."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from handscope.estimators.data.samples import ACC, GYR
from handscope.sessions.formats import recordings
from tests.journeys.house import SIZES, Server, api, figure, new_patient, shots, shown
from tests.journeys.test_accessibility import PHONE, looked_at

pytestmark = pytest.mark.browser
WORN = ("hand", "thumb_metacarpal", "thumb_proximal", "thumb_distal", "index_proximal", "index_middle", "index_distal")  # fmt: skip
GRAVITY = 9.80665


@pytest.fixture(scope="module")
def german(recording: Path) -> tuple[bytes, dict[str, str]]:
    """Decimal commas, degrees and g, columns shuffled under names that say nothing; the segment of each sensor's letter."""
    loaded = recordings.load(recording)
    block = max(loaded.samples.values(), key=lambda b: len(b.stream.sensors))
    columns = {"zeit": 1e3 * (block.t - block.t[0])}
    letters = dict(zip("klmnopq", WORN))
    for letter, point in letters.items():
        k = block.stream.sensors.index(point)
        for kind, quantity, unit in (("1", GYR, np.pi / 180), ("2", ACC, GRAVITY)):
            values = (block.of(quantity)[:, k] / unit).T
            columns |= {f"{letter}{kind}_{c}": v for c, v in zip("uvw", values)}
    names = list(np.random.default_rng(1).permutation(list(columns)))
    rows = np.column_stack([columns[n] for n in names])
    lines = [";".join(f"{v:.5f}" for v in row).replace(".", ",") for row in rows]
    return "\n".join(["Logger 7;exported", ";".join(names), *lines]).encode(), letters


def send(page: Page, data: bytes) -> None:
    page.locator("input[type=file][accept*='.csv']").set_input_files(
        {"name": "log.csv", "mimeType": "text/csv", "buffer": data}
    )
    page.locator(".drop ~ p button, form p button.primary").filter(visible=True).last.click()
    page.wait_for_url("**/tables/*")


def pictures(page: Page, name: str) -> None:
    """At three sizes, light and dark, where they are wanted."""
    if not shots():
        return
    for size, (width, height) in {**SIZES, "phone": PHONE}.items():
        page.set_viewport_size({"width": width, "height": height})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
            page.screenshot(path=Path(shots()) / f"{name}-{size}-{scheme}.png", full_page=True)
    page.emulate_media(color_scheme="light")
    page.set_viewport_size({"width": 1024, "height": 768})


def choose_segments(page: Page, letters: dict[str, str]) -> None:
    """Tell of every line whose sensor it is; the page finds the quantity by itself."""
    for k in range(2 * len(letters)):
        first = page.get_by_label(f"Line {k + 1}, x", exact=True).input_value()
        page.get_by_label(f"Segment of line {k + 1}", exact=True).select_option(letters[first[0]])
        expect(page.get_by_label(f"Quantity of line {k + 1}", exact=True)).to_have_value(
            {"1": "gyr", "2": "acc"}[first[1]]
        )


def store(page: Page) -> None:
    page.get_by_role("button", name="Store and process").click()
    page.wait_for_url("**/sessions/*")


def test_a_german_table_of_an_unknown_logger_is_mapped_and_assessed(
    another_page: Callable[..., Page], german: tuple[bytes, dict[str, str]]
) -> None:
    data, letters = german
    page = another_page(scene=False, at="/", bypass_csp=True)
    page.goto(f"/patients/{new_patient(page)}")
    send(page, data)
    expect(shown(page.get_by_label("Column of the times"))).to_have_value("zeit")
    expect(page.get_by_text("Choose the segment of at least one line.")).to_be_visible()
    lines = page.locator(".mapped").first.locator("li")
    expect(lines).to_have_count(2 * len(letters))
    choose_segments(page, letters)
    shown(page.get_by_text("accelerometers read 1.00 at rest: taken as g"))
    looked_at(page, "a table that is mapped", wider=["First rows"])
    pictures(page, "table")

    page.get_by_label("Unit of line 1", exact=True).select_option(index=0)
    units = page.get_by_label("Unit of line 1", exact=True).input_value()
    expect(shown(page.locator(".error, .findings .warning"))).to_contain_text("unit")
    page.get_by_label("Unit of line 1", exact=True).select_option(
        {"rad/s": "deg/s", "m/s^2": "g"}[units]
    )
    shown(page.get_by_text("accelerometers read 1.00 at rest: taken as g"))
    expect(page.get_by_label("Begin of line 1, s")).not_to_have_value("")
    page.get_by_role("button", name="Add a pose or task").click()
    page.get_by_label("What was done, line 2").select_option("task:tapping")
    page.get_by_label("Begin of line 2, s").fill("7")
    page.get_by_label("End of line 2, s").fill("14.8")
    store(page)
    shown(page.get_by_role("heading", name="Finger tapping"))
    taps, *_ = figure(page, "Taps").split()  # with its standard deviation, where it has one
    assert int(taps) > 15  # the task was typed, not taken from the recording


@pytest.mark.slow
def test_the_map_is_offered_again_and_the_page_speaks_german(
    another_page: Callable[..., Page], server: Server, german: tuple[bytes, dict[str, str]]
) -> None:
    data, letters = german
    before = another_page(scene=False, at="/")
    before.goto(f"/patients/{new_patient(before)}")
    send(before, data)
    choose_segments(before, letters)
    shown(before.get_by_text("accelerometers read 1.00 at rest: taken as g"))
    store(before)
    page = another_page(scene=False, at="/", locale="de-DE", bypass_csp=True)
    patient = new_patient(page)
    page.goto(f"/patients/{patient}")
    send(page, data)
    shown(page.get_by_text("Wie bei der letzten Tabelle mit diesen Spalten"))
    shown(page.get_by_text("Beschleunigungssensoren zeigen in Ruhe 1,00: als g verstanden"))
    looked_at(page, "a table in German", wider=["Erste Zeilen"])
    pictures(page, "table-de")
    page.get_by_role("button", name="Tabelle verwerfen").click()
    page.wait_for_url("**/patients/*")
    assert api(page, f"/api/patients/{patient}")["sessions"] == []
