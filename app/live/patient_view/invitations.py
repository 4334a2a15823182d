"""Permissions for the patient's own screen to show a live session: a short code, valid once, becomes the screen's token.

Codes and tokens are kept as their sha256, in memory alone: a restart of the server ends every screen. A screen follows
the visit to the other hand, and ends with it.
"""

import hashlib
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from handscope.estimators.errors import InputError

ALPHABET = "23456789ABCDEFGHJKMNPQRSTVWXYZ"  # without characters that are mistaken for others
CODE_LENGTH = 8  # characters: 6e11 codes, and tries are delayed (sessions/login/throttle.py)
CODE_LIFE = 600.0  # s until a code that was not used is worth nothing
SCREEN_LIFE = 4 * 3600.0  # s that a screen may show a session
MOST_SCREENS = 4  # of a station, those that are invited and not there yet among them


@dataclass
class Screen:
    """A screen of a station, invited (no token yet) or there; `shown_at` is the address that used the code."""

    name: str  # shown in lists; gives no access
    station: str
    language: str
    by: str  # the account that invited it
    made: float  # s, the registry's clock
    shown_at: str = ""
    began: float | None = None  # s, when the code was used
    withdrawn: threading.Event = field(default_factory=threading.Event)

    @property
    def is_open(self) -> bool:
        """Whether its code was used."""
        return self.began is not None


class Invitations:
    """All screens of a server by the hash of their code, then of their token."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._invited: dict[str, Screen] = {}
        self._screens: dict[str, Screen] = {}
        self._clock = clock
        self._lock = threading.Lock()

    def invite(self, station: str, language: str, by: str) -> tuple[Screen, str]:
        """A new screen and its code; InputError for one screen too many."""
        code = "".join(secrets.choice(ALPHABET) for _ in range(CODE_LENGTH))
        screen = Screen(secrets.token_hex(4), station, language, by, self._clock())
        with self._lock:
            if len(self._of(station)) >= MOST_SCREENS:
                raise InputError("live.too_many_screens", screens=MOST_SCREENS)
            self._invited[_digest(code)] = screen
        return screen, f"{code[:4]}-{code[4:]}"

    def open(self, code: str, address: str) -> tuple[Screen, str] | None:
        """The screen of a code and its token; None for a code that is unknown, was used before or is too old."""
        with self._lock:
            screen = self._invited.pop(_digest(_normalise_code(code)), None)
            if screen is None or not self.is_due(screen):
                return None
            token = secrets.token_urlsafe(32)
            screen.began, screen.shown_at = self._clock(), address
            self._screens[_digest(token)] = screen
        return screen, token

    def screen_of(self, token: str | None) -> Screen | None:
        """The screen of a token; None where there is none, or it ended."""
        with self._lock:
            screen = self._screens.get(_digest(token or ""))
            return screen if screen is not None and self.is_due(screen) else None

    def list_of(self, station: str) -> list[Screen]:
        with self._lock:
            return self._of(station)

    def hand_over(self, station: str, following: str) -> None:
        """Let the screens of a station show the one that follows it."""
        with self._lock:
            for screen in self._of(station):
                screen.station = following

    def withdraw(self, station: str, name: str = "") -> None:
        """End one screen of a station, or all of them."""
        with self._lock:
            for screens in (self._invited, self._screens):
                for digest, screen in list(screens.items()):
                    if screen.station == station and name in ("", screen.name):
                        del screens[digest]
                        screen.withdrawn.set()

    def _of(self, station: str) -> list[Screen]:
        """The screens of a station that may show it still; those of every station that may not are forgotten."""
        for screens in (self._invited, self._screens):
            for digest in [d for d, s in screens.items() if not self.is_due(s)]:
                screens.pop(digest).withdrawn.set()
        every = (*self._invited.values(), *self._screens.values())
        return sorted((s for s in every if s.station == station), key=lambda s: s.made)

    def is_due(self, screen: Screen) -> bool:
        """Whether the time of its code, or of the screen, is not over."""
        if screen.began is None:
            return self._clock() - screen.made <= CODE_LIFE
        return self._clock() - screen.began <= SCREEN_LIFE


def _normalise_code(code: str) -> str:
    """A code as people type it: with spaces, hyphens and small letters."""
    return "".join(c for c in code.upper() if c.isalnum())


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
