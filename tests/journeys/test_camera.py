"""A camera's hand landmarks beside an uploaded recording: what differs, and what such a camera is good for, in English and German."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from handscope.sessions.motion_bids import kinematics
from tests.journeys.house import keep_screen, shown
from tests.sessions.formats.test_landmarks import as_json, seen

pytestmark = pytest.mark.browser
WORDS = {
    "en-GB": ("Beside a camera", "Landmark file", "Compare", "100 % show a hand",
              "The camera's clock reads 12.5", "never the instrument", "Index PIP: flexion and extension"),
    "de-DE": ("Neben einer Kamera", "Datei mit Landmarken", "Vergleichen", "auf 100 % ist eine Hand",
              "Die Uhr der Kamera zeigt 12,5", "nie das Messgerät", "Zeigefinger PIP: Beugung und Streckung"),
}  # fmt: skip


@pytest.fixture
def camera(recording: Path, tmp_path: Path) -> bytes:
    """What a camera without noise saw of the simulated hand; its clock reads 12.5 s more."""
    with zipfile.ZipFile(recording) as archive:
        archive.extractall(tmp_path)
    files, tables, _ = kinematics.tables_at(tmp_path / "derivatives" / "truth")
    truth = kinematics.load(files, tables[0], None).trajectory
    assert truth is not None
    every = slice(None, None, round(len(truth.t) / (truth.t[-1] - truth.t[0]) / 30.0))
    return as_json(truth.t[every] + 12.5, seen(truth.angles[every], "left")).encode()


def send(page: Page, name: str, content: bytes, words: tuple[str, ...]) -> Locator:
    """The card, with the file sent."""
    title, label, compare = words[:3]
    shown(page.get_by_text(title)).click()
    page.get_by_label(label).set_input_files(
        {"name": name, "mimeType": "application/json", "buffer": content}
    )
    card = page.locator(".card").filter(has_text=title)
    card.get_by_role("button", name=compare, exact=True).click()
    return card


@pytest.mark.parametrize("language", ["en-GB", pytest.param("de-DE", marks=pytest.mark.slow)])
def test_a_cameras_landmarks_stand_beside_a_result_with_their_limits(
    another_page: Callable[..., Page], processed: int, camera: bytes, language: str
) -> None:
    page = another_page(scene=False, at=f"/sessions/{processed}", locale=language)
    words = WORDS[language]
    card = send(page, "phone.json", camera, words)
    expect(shown(card.get_by_text("phone.json"))).to_contain_text(words[3])
    for sentence in words[4:6]:
        expect(card).to_contain_text(sentence)
    expect(card).to_contain_text("5° ")  # its standard deviation, 5° to 10°
    cells = card.get_by_role("row", name=words[6]).get_by_role("cell")
    drms = float(cells.nth(1).inner_text().rstrip("°").replace(",", "."))
    assert 0.0 < drms < 3.0  # without noise, from the straight line of its points
    card.locator("select").first.select_option(index=1)
    shown(card.locator(".uplot"))
    card.locator(".uplot").first.scroll_into_view_if_needed()
    keep_screen(page, f"camera-{language}")
    card.locator("table").scroll_into_view_if_needed()
    keep_screen(page, f"camera-table-{language}")


def test_a_file_that_is_no_landmarks_is_one_sentence(
    another_page: Callable[..., Page], processed: int
) -> None:
    page = another_page(scene=False, at=f"/sessions/{processed}")
    send(page, "letter.json", b"Dear colleague", WORDS["en-GB"])
    expect(shown(page.locator(".error").filter(has_text="letter.json"))).to_contain_text("no JSON")
