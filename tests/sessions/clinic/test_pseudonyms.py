"""What may be a name is asked about; what is plainly a code is not."""

import pytest

from handscope.sessions.clinic.pseudonyms import DOUBTS, find_doubts


@pytest.mark.parametrize(
    "code",
    [
        "H-017",
        "P0001",
        "study 4 / 12",
        "A7",
        "left-3",
        "CIDP-22",
        "2026-017",
        "ward 3 bed 2",
        "x",
        "HRT-A4",
        "SUB 12",
        "2026-11 / 4",
    ],
)
def test_a_code_raises_no_doubt(code: str) -> None:
    assert find_doubts(code) == ()


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        ("Anna Berg", {"words", "name"}),
        ("anna berg", {"words"}),
        ("ANNA BERG", {"words"}),
        ("Berg", {"words"}),
        ("Berg, A.", {"comma"}),
        ("Zoë O'Brien", {"words", "name"}),
        ("Łukasz Żak 2", {"name"}),
        ("Anna-Lena Berg 3", {"name"}),
        ("Mr. B7", {"address"}),
        ("Frau 12", {"address"}),
        ("AB 12.03.1961", {"date"}),
        ("AB 3/12/61", {"date"}),
        ("AB19610312", set()),
        ("AB 19610312", {"date"}),
        ("1961-03-12", {"date"}),
    ],
)
def test_what_may_be_a_name_or_a_day_of_birth_is_asked_about(typed: str, found: set[str]) -> None:
    assert set(find_doubts(typed)) == found
    assert found <= set(DOUBTS)
