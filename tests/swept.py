"""Cases of a sweep: `make test` takes one or the extremes of them, `make test-all` the others, too (CONTRIBUTING.md)."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def swept(cases: Iterable[Any], kept: Collection[Any]) -> list[Any]:
    """The cases, those that are not `kept` marked as slow."""
    found = list(cases)
    assert kept and all(case in found for case in kept), f"{kept} are not among the cases"
    return [case if case in kept else pytest.param(case, marks=pytest.mark.slow) for case in found]
