"""A code opens one screen of one session, once and soon; what ends the screen ends it for good."""

import re

import pytest

from handscope.app.live.patient_view.invitations import (
    ALPHABET,
    CODE_LENGTH,
    CODE_LIFE,
    MOST_SCREENS,
    SCREEN_LIFE,
    Invitations,
)
from handscope.estimators.errors import InputError


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


def opened(screens: Invitations, station: str = "one") -> str:
    found = screens.open(screens.invite(station, "de", "anna")[1], "10.0.0.7")
    assert found is not None
    return found[1]


def test_a_code_opens_one_screen_once_however_it_is_typed() -> None:
    screens = Invitations()
    invited, code = screens.invite("one", "de", "anna")
    assert re.fullmatch(rf"[{ALPHABET}]{{4}}-[{ALPHABET}]{{4}}", code)
    assert len(ALPHABET) ** CODE_LENGTH > 5e11 and not set(ALPHABET) & set("01IOLU")
    assert not invited.is_open and screens.open("AAAA-AAAA", "10.0.0.7") is None
    found = screens.open(f" {code.lower().replace('-', ' ')} ", "10.0.0.7")
    assert found is not None
    screen, token = found
    assert (screen.is_open, screen.shown_at, screen.language) == (True, "10.0.0.7", "de")
    assert screens.screen_of(token) is screen
    assert screens.open(code, "10.0.0.8") is None
    assert [screens.screen_of(t) for t in (None, "", code, token[:-1])] == [None] * 4


def test_a_code_and_a_screen_end_by_themselves() -> None:
    clock = Clock()
    screens = Invitations(clock)
    late, early = screens.invite("one", "en", "anna")[1], screens.invite("one", "en", "anna")[1]
    clock.now += CODE_LIFE
    found = screens.open(early, "")
    assert found is not None
    clock.now += 1.0
    assert screens.open(late, "") is None
    clock.now += SCREEN_LIFE - 1.0
    assert screens.screen_of(found[1]) is found[0]
    clock.now += 1.0
    assert screens.screen_of(found[1]) is None and screens.list_of("one") == []


def test_ending_a_screen_or_its_session_ends_it_for_good() -> None:
    screens = Invitations()
    first, second, other = opened(screens), opened(screens), opened(screens, "two")
    waiting = screens.invite("one", "en", "anna")[1]
    ended = screens.screen_of(first)
    assert ended is not None
    screens.withdraw("one", ended.name)
    assert ended.withdrawn.is_set() and screens.screen_of(first) is None
    assert screens.screen_of(second) is not None
    screens.withdraw("one")
    assert screens.screen_of(second) is None and screens.open(waiting, "") is None
    assert screens.screen_of(other) is not None


def test_a_screen_follows_the_session_to_the_other_hand() -> None:
    screens = Invitations()
    token = opened(screens)
    screens.hand_over("one", "two")
    screens.withdraw("one")
    screen = screens.screen_of(token)
    assert screen is not None and screen.station == "two"


def test_a_session_has_a_few_screens_and_no_more() -> None:
    screens = Invitations()
    for _ in range(MOST_SCREENS):
        opened(screens)
    with pytest.raises(InputError, match=f"has {MOST_SCREENS} screens already"):
        screens.invite("one", "en", "anna")
    screens.invite("two", "en", "anna")
