"""Nobody reads our keys: every page, replay and report of a patient with ranges, taps, treatment and a goal, in every language, holds words alone."""

import re
from io import BytesIO
from pathlib import Path

import pytest
from playwright.sync_api import Page
from pypdf import PdfReader

from handscope.app.language import languages
from tests.journeys.house import Server, api, new_patient, shown, simulate

pytestmark = [pytest.mark.browser, pytest.mark.slow]
KEY = re.compile(r"(?<![\w./-])[a-z]+\d*(?:_[a-z0-9]+)+(?![\w./-])|\d deg\b")
MARKUP = re.compile(r"<(style|script).*?</\1>|<[^>]*>", re.S)
WORDS = """() => {
  document.querySelectorAll("details").forEach((one) => (one.open = true));
  const named = [...document.querySelectorAll("[aria-label], [title], [placeholder]")];
  const said = named.map((one) => [one.getAttribute("aria-label"), one.title, one.placeholder]);
  const choices = [...document.querySelectorAll("option")].map((one) => one.textContent);
  return [document.body.innerText, ...choices, ...said.flat()].join("\\n");
}"""


def test_no_page_and_no_report_shows_a_key(
    page_without_scene: Page, server: Server, recording: Path, tmp_path: Path
) -> None:
    page = page_without_scene
    patient = new_patient(page)
    fist = simulate(tmp_path / "fist.zip", "rom_fist")
    sessions = []
    for k, name in enumerate(("fist", "tapping", "tapping")):
        packed = (fist if name == "fist" else recording).read_bytes()
        packed = packed[:-2] + b"\x01\x00" + bytes([65 + k])  # each a recording of its own
        sent = {"file": {"name": f"{name}.zip", "mimeType": "application/zip", "buffer": packed}}
        told = api(page, f"/api/patients/{patient}/recordings", "POST", multipart=sent)
        sessions.append(told["session"])
        page.goto(f"{server.base}/sessions/{told['session']}")
        shown(page.get_by_role("link", name="Replay in 3-D").or_(page.get_by_role("button", name="Replay in 3-D")))  # fmt: skip
    treated = {"kind": "botulinum_toxin", "hand": "left", "day": "2026-05-20"}
    api(page, f"/api/patients/{patient}/treatment-events", "POST", data=treated)
    rate = {"measure": "tapping", "task": "tapping", "name": "tapping_rate", "unit": "per s"}
    goal = {**rate, "hand": "left", "low": 3, "high": 4}
    api(page, f"/api/patients/{patient}/goals", "PUT", data=goal)
    page.get_by_role("button", name="Replay in 3-D").click()
    page.wait_for_url(re.compile(r"/stations/\w+$"))
    replay = page.url.removeprefix(server.base)
    shows = {}
    places = ["/", f"/patients/{patient}", *(f"/sessions/{s}" for s in sessions), replay]
    for language in languages():
        page.evaluate("(one) => localStorage.setItem('handscope-language', one)", language)
        for place in (*places, "/protocols", "/devices", "/help", "/account", "/audit"):
            page.goto(f"{server.base}{place}")
            page.wait_for_load_state("networkidle")
            assert page.locator("html").get_attribute("lang") == language
            shows[language, place] = KEY.findall(page.evaluate(WORDS))
        for session in sessions:
            result = api(page, f"/api/sessions/{session}")["recordings"][0]["results"][0]["id"]
            answer = page.request.get(f"/api/results/{result}/report.html?language={language}")
            shows[language, f"report {session}"] = KEY.findall(MARKUP.sub(" ", answer.text()))
        progress = page.request.get(
            f"/api/patients/{patient}/progress.pdf?hand=left&language={language}"
        )
        printed = "\n".join(p.extract_text() for p in PdfReader(BytesIO(progress.body())).pages)
        assert printed.strip()
        shows[language, "progress.pdf"] = KEY.findall(printed)
    assert {place: keys for place, keys in shows.items() if keys} == {}
