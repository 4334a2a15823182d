"""How many clicks an assessment takes, counted by the browser: from the list of patients to the report."""

import pytest
from playwright.sync_api import Page

from tests.journeys.house import Server, act, api, new_patient, shown

pytestmark = [pytest.mark.browser, pytest.mark.slow]
COUNTED = """
document.addEventListener("click", (event) => {
  if (event.isTrusted) sessionStorage.clicks = Number(sessionStorage.clicks ?? 0) + 1;
}, true);
"""
MOST = 16
TASKS = ["rom_fist", "rom_mcp", "rom_pip", "rom_dip", "prom_fist"]


def test_five_tasks_from_the_list_of_patients_to_the_report_take_at_most_sixteen_clicks(
    page_without_scene: Page, server: Server
) -> None:
    page = page_without_scene
    patient = new_patient(page)
    glove = next(g["path"] for g in api(page, "/api/gloves") if g["hand"] == "left")
    earlier = {"hand": "left", "port": glove, "plan": "flexor_tendon_repair"}
    begun = api(
        page, f"/api/patients/{patient}/sessions", "POST", data=earlier
    )  # the protocol is the patient's from now on
    api(page, f"/api/stations/{begun['station']}", "DELETE")
    page.add_init_script(COUNTED)
    page.goto(server.base)
    code = api(page, f"/api/patients/{patient}")["pseudonym"]
    page.get_by_role("link", name=code).click()
    shown(page.locator("select[name=plan]"))
    page.get_by_role("button", name="Start session").click()
    shown(act(page, "continue")).click()
    shown(act(page, "start")).click()
    shown(act(page, "onward")).click()
    for k, _ in enumerate(TASKS):
        shown(act(page, "start")).click()
        shown(act(page, "onward" if k < len(TASKS) - 1 else "close")).click()
    page.wait_for_url("**/sessions/*")
    with page.expect_popup():
        shown(page.get_by_role("link", name="Report (PDF)")).click()
    clicks = int(page.evaluate("sessionStorage.clicks"))
    events = api(page, f"/api/sessions/{page.url.rsplit('/', 1)[1].split('?')[0]}")["recordings"][0]
    done = [e["task"] for e in events["summary"]["events"] if e["trial_type"] == "task"]
    assert done == TASKS
    assert clicks <= MOST
