"""viser's page: one file with our style, and a policy whose nonce fits one answer."""

import re

import pytest

from handscope.app.scene.viser_page import scene_page


def test_the_page_is_one_file_with_our_style() -> None:
    page = scene_page("hand.clinic").html or b""
    assert page.count(b"<title>") == 1 and b"<title>Hand</title>" in page
    assert b"mantine-Paper-root" in page
    assert b'<script src="' not in page and b'rel="stylesheet"' not in page


def test_each_answer_has_its_own_nonce_and_every_script_of_its_page_bears_it() -> None:
    first, second = scene_page("hand.clinic"), scene_page("hand.clinic")
    assert first.policy != second.policy
    for page in (first, second):
        assert page.html is not None
        nonces = re.findall(r'<script nonce="([^"]+)"', page.html.decode())
        assert len(nonces) == page.html.count(b"</script>") == 2
        assert {f"'nonce-{nonce}'" for nonce in nonces} < rules(page.policy, "script-src")


def test_a_browser_that_keeps_the_page_is_answered_with_its_own_nonce() -> None:
    first, second = scene_page("hand.clinic"), scene_page("hand.clinic")
    assert first.tag != second.tag
    again = scene_page("hand.clinic", f'W/"other", {first.tag}')
    assert (again.html, again.policy, again.tag) == (None, first.policy, first.tag)
    nonce = first.tag.strip('"').split("-", 1)[1]
    for kept in (f'"{"0" * 16}-{nonce}"', first.tag.replace(nonce, nonce[1:] + "'"), nonce, "*"):
        fresh = scene_page("hand.clinic", kept)
        assert fresh.html is not None and fresh.policy != first.policy, kept


def test_the_policy_lets_the_page_talk_to_its_own_host_only() -> None:
    policy = scene_page("hand.clinic:8443").policy
    assert rules(policy, "default-src") == {"'none'"}
    assert not rules(policy, "script-src") & {"'unsafe-eval'", "'unsafe-inline'", "'self'"}
    ours = {"'self'", "data:", "blob:", "ws://hand.clinic:8443", "wss://hand.clinic:8443"}
    assert rules(policy, "connect-src") == ours
    assert "ws://[::1]:8000" in rules(scene_page("[::1]:8000").policy, "connect-src")


@pytest.mark.parametrize(
    "host", ["", "a b", "evil; script-src *", "a\r\nx", "ä", "*", "a:b", "http://a"]
)
def test_a_host_that_is_none_gets_no_policy(host: str) -> None:
    with pytest.raises(ValueError, match="is not a host name"):
        scene_page(host)


def rules(policy: str, name: str) -> set[str]:
    """What a directive of the policy allows."""
    allowed = dict(rule.split(" ", 1) for rule in policy.split("; "))[name]
    return set(allowed.split())
