"""Reports of these tests differ in their words: a plot of the same figures is drawn once, for it takes three quarters of a report's time."""

import pickle
from collections.abc import Callable, Iterator
from functools import wraps

import pytest

from handscope.app.report.sections import plots

DRAWN = {name: getattr(plots, name) for name in ("range_chart", "flexion_curves", "tapping_chart")}


@pytest.fixture(scope="package", autouse=True)
def drawn_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for name, draw in DRAWN.items():
            patch.setattr(plots, name, _once(draw))
        yield


@pytest.fixture
def drawn_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """For a test of drawing itself."""
    for name, draw in DRAWN.items():
        monkeypatch.setattr(plots, name, draw)


def _once(draw: Callable[..., str]) -> Callable[..., str]:
    drawn: dict[bytes, str] = {}

    @wraps(draw)
    def drawn_or_kept(*given: object) -> str:
        key = pickle.dumps(given)
        if key not in drawn:
            drawn[key] = draw(*given)
        return drawn[key]

    return drawn_or_kept
