"""A protocol is changed in the browser, goes to another house as a file, leads a session, and the session says which version it had."""

import json
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.journeys.house import Server, act, api, end_session, keep_screen, new_patient, shown

pytestmark = pytest.mark.browser


def test_a_protocol_is_changed_exported_imported_and_leads_a_session(
    page_without_scene: Page, server: Server, tmp_path: Path
) -> None:
    page = page_without_scene
    page.goto(f"{server.base}/protocols")
    page.get_by_role("button", name="Flexor tendon repair").click()
    keep_screen(page, "protocols")
    first = page.locator(".plan-tasks > li").first
    expect(first).to_contain_text("Fist and stretch")
    first.get_by_label("Trials").fill("2")
    first.get_by_label("Seconds").fill("10")
    page.get_by_role("button", name="Earlier: End joints (DIP)", exact=True).click()
    page.get_by_role("button", name="Leave out: Fist and stretch, passive").click()
    page.get_by_label("Add a task").select_option("tapping")
    page.get_by_role("button", name="Save as version 2").click()
    shown(page.get_by_role("button", name="Save as version 3"))
    with page.expect_download() as download:
        page.get_by_role("link", name="Export as a file").click()
    file = tmp_path / "flexor.json"
    download.value.save_as(file)
    content = json.loads(file.read_text())
    assert [t["task"] for t in content["tasks"]] == ["rom_fist", "rom_mcp", "rom_dip", "rom_pip", "tapping"]  # fmt: skip
    assert content["tasks"][0] == {"task": "rom_fist", "trials": 2, "seconds": 10.0}
    file.write_text(json.dumps({**content, "name": "zone_two", "title": "Zone II repair"}))
    page.locator("input[type=file]").set_input_files(file)
    shown(page.get_by_role("heading", name="Zone II repair"))

    page.goto(f"{server.base}/patients/{new_patient(page)}")
    page.get_by_label("Protocol").select_option("zone_two")
    shown(page.get_by_text("Active motion only when the treating surgeon has cleared it."))
    page.get_by_role("radio", name="Virtual left glove").check()
    page.get_by_role("button", name="Start session").click()
    page.wait_for_url("**/stations/*")
    shown(act(page, "continue")).click()
    shown(act(page, "without")).click()
    page.get_by_role("button", name="Go on without").click()
    shown(page.get_by_label("Which tasks?")).evaluate("element => element.focus()")
    expect(page.locator("[data-task]").nth(1)).to_contain_text("Knuckles (MCP)")
    expect(page.get_by_text("Zone II repair").first).to_be_attached()
    end_session(page)
    shown(page.get_by_text("Zone II repair, version 1"))
    session = api(page, f"/api/sessions/{page.url.rsplit('/', 1)[1].split('?')[0]}")
    assert session["plan"] == {"name": "zone_two", "version": 1, "title": "Zone II repair"}
