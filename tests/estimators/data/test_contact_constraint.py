"""What places that touch say of each other: derivatives, and what a table of unknown height leaves open."""

import numpy as np
import pytest

from handscope.estimators.data.contact_constraint import (
    LASTING,
    ContactParams,
    between_two,
    growth,
    on_a_plane,
    places_of,
)
from handscope.estimators.data.events import Event
from handscope.estimators.data.held_contact import (
    Contact,
    HeldContact,
    held_contacts,
    parse_contacts,
)
from handscope.estimators.numerics.typing import Array

PARAMS, STEP = ContactParams(), 1e-6


def held(words: str) -> list[tuple[str, ...]]:
    found = held_contacts([Event(3.0, 2.0, "contact", {"contacts": words})])
    return [h.fingers for h in found]


def test_fingertips_of_one_event_are_on_one_table_and_pairs_are_contacts_of_their_own() -> None:
    table = "thumb_bottom-table_top index_bottom-table_top middle_bottom-table_top"
    assert held(table) == [("thumb", "index", "middle")]
    pairs = "thumb_bottom-index_bottom middle_bottom-palm_middle"
    assert held(f"{table} {pairs}") == [
        ("thumb", "index"),
        ("middle",),
        ("thumb", "index", "middle"),
    ]


@pytest.mark.parametrize(
    "words",
    [
        "index_bottom-table_top middle_bottom-table_top",  # any tilt explains two
        "index_bottom-table_top index_bottom-table_top index_distal-table_top",
        "table_top-index_bottom",
        "index_bottom-palm_nose",
        "index_bottom-index_distal",
    ],
)
def test_contacts_that_tell_nothing_are_passed_over(words: str) -> None:
    assert held(words) == []


def test_measures_of_pinches_see_fingertips_only() -> None:
    words = "thumb_distal-index_distal index_bottom-table_top middle_bottom-palm_middle"
    assert [c.part for c in parse_contacts({"contacts": words})] == ["thumb_index"]


def test_a_contact_with_the_palm_is_between_the_fingertip_and_its_mark() -> None:
    (one,) = held_contacts([Event(0.0, 2.0, "contact", {"contacts": "thumb_bottom-palm_ring"})])
    assert places_of(one) == (("thumb", "bottom"), ("palm", "ring"))


def vertical_of(count: int) -> Array:
    return np.tile([0.9, 0.1, np.sqrt(1 - 0.82)], (count, 1))


def test_places_on_a_plane_have_no_residual_whatever_its_height(rng: np.random.Generator) -> None:
    up = vertical_of(5)
    places = rng.normal(size=(5, 3))
    places -= (places * up).sum(axis=1)[:, None] * up
    for height in (0.0, -0.06):
        found = on_a_plane(PARAMS, places + height * up, up)
        np.testing.assert_allclose(found.residual, 0.0, atol=1e-12)
        assert found.missed < 1e-12


def test_a_table_of_unknown_tilt_explains_what_a_tilt_makes() -> None:
    """Of three places nothing is left that a plane cannot be turned to; their noise grows with the tilt."""
    up, places = (
        vertical_of(3),
        0.05 * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.3]]),
    )
    small, large = (
        on_a_plane(ContactParams(table_tilt=tilt), places, up).noise for tilt in (0.1, 10.0)
    )
    assert np.linalg.eigvalsh(large - small).min() > 0
    assert np.linalg.eigvalsh(large).max() > (0.05 * np.radians(10.0)) ** 2


def test_derivatives_by_places_and_vertical_are_those_of_differences(
    rng: np.random.Generator,
) -> None:
    places, up = 0.1 * rng.normal(size=(4, 3)), vertical_of(4)
    plane = on_a_plane(PARAMS, places, up)
    a, b = ("thumb", "bottom"), ("index", "bottom")
    pairs = [HeldContact((Contact(a, b, d),), 0.0, 2.0) for d in (None, 0.05)]
    touch, spaced = (between_two(PARAMS, places[:2], pair) for pair in pairs)
    for k in range(4):
        for a in range(3):
            moved, turned = places.copy(), up.copy()
            moved[k, a] += STEP
            turned[k, a] += STEP
            by_place = (on_a_plane(PARAMS, moved, up).residual - plane.residual) / STEP
            by_up = (on_a_plane(PARAMS, places, turned).residual - plane.residual) / STEP
            np.testing.assert_allclose(plane.by_places[k, :, a], by_place, atol=1e-8)
            np.testing.assert_allclose(plane.by_vertical[k, :, a], by_up, atol=1e-8)
            for one, pair in zip((touch, spaced), pairs if k < 2 else ()):
                after = between_two(PARAMS, moved[:2], pair).residual
                np.testing.assert_allclose(
                    one.by_places[k, :, a], (after - one.residual) / STEP, atol=1e-4
                )


def test_a_contact_that_is_held_again_never_tells_more_than_what_lasts_allows() -> None:
    information = np.cumsum([1 / growth(times) for times in range(200)])
    assert information[0] == 1.0
    assert (np.diff(information) > 0).all()
    np.testing.assert_allclose(information[-1], 1 / LASTING, rtol=0.01)
