"""What did not change from one message to the next is known by one look, and whatever did is drawn again."""

from typing import Any

import pytest
from playwright.sync_api import Browser

from handscope.app.api.broadcast import changed
from tests.app.pages.test_metronome_in_browser import SITE, serve

pytestmark = pytest.mark.browser
DRAWN = """async ([select, messages]) => {
  const { whenChanged } = await import("/static/dom.js");
  const { sharing } = await import("/static/same.js");
  const picked = new Function("message", `return ${select}`);
  const drawn = [];
  const draw = whenChanged(picked, (value) => drawn.push(JSON.stringify(value)));
  let latest = null;
  let looked = 0;
  for (const message of messages) {
    const before = latest;
    latest = sharing(before, structuredClone(message));
    if (before && JSON.stringify(before.kept) === JSON.stringify(latest.kept)) looked += before.kept !== latest.kept;
    draw(latest);
  }
  return { drawn, looked };
}"""
KEPT = {"joints": [{"name": "pip", "deg": [1, 2]}], "none": None}
OTHERS: list[dict[str, Any]] = [
    {**KEPT, "more": 1},
    {"joints": KEPT["joints"]},
    {**KEPT, "joints": [{"name": "pip", "deg": [1]}]},
    {**KEPT, "joints": [{"name": "pip", "deg": [1, 3]}]},
    {**KEPT, "joints": {"0": {"name": "pip", "deg": [1, 2]}}},
    {**KEPT, "none": 0},
]


def drawn(browser: Browser, select: str, messages: list[dict[str, Any]]) -> dict[str, Any]:
    return evaluated(browser, DRAWN, [select, messages])


def evaluated(browser: Browser, script: str, given: list[Any]) -> dict[str, Any]:
    context = browser.new_context()
    page = context.new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    found: dict[str, Any] = page.evaluate(script, given)
    context.close()
    return found


def test_only_what_changed_is_drawn_again_and_the_rest_stays_the_same_object(
    browser: Browser,
) -> None:
    clocked = [{"clock": k, "kept": KEPT} for k in range(5)]
    found = drawn(browser, "message.kept", clocked)
    assert (len(found["drawn"]), found["looked"]) == (1, 0)
    assert len(drawn(browser, "[message.kept, message.clock]", clocked)["drawn"]) == 5


CHANGED = """async ([full, changes]) => {
  const { withChanges } = await import("/static/same.js");
  const before = JSON.stringify(full);
  const now = withChanges(full, changes);
  return { now, kept: JSON.stringify(full) === before, shared: now.kept === full.kept };
}"""


@pytest.mark.parametrize("other", [*OTHERS, KEPT, None, [1]])
def test_changes_put_into_the_whole_give_the_next_whole_and_leave_the_last_as_it_is(
    browser: Browser, other: Any
) -> None:
    whole = {"kept": [1, 2], "a": {"b": KEPT, "c": 1}}
    now = {"kept": [1, 2], "a": {"b": other, "c": 2}}
    found = evaluated(browser, CHANGED, [whole, changed(whole, now)])
    assert found == {"now": now, "kept": True, "shared": True}
    assert evaluated(browser, CHANGED, [whole, changed(whole, {"b": 1})])["now"] == {"b": 1}


def test_every_kind_of_change_is_seen(browser: Browser) -> None:
    for other in OTHERS:
        turns = [{"kept": one} for one in (KEPT, other, KEPT)]
        assert len(drawn(browser, "message.kept", turns)["drawn"]) == 3, other
    assert len(drawn(browser, "undefined", [{"kept": KEPT}])["drawn"]) == 1
