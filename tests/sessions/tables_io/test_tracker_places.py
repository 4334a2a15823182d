"""Where trackers sat is kept by hand and tracker; what cannot be is refused before anything is kept."""

from pathlib import Path

import pytest

from handscope.estimators.errors import InputError
from handscope.sessions.tables_io.tracker_places import (
    FILE,
    read_places,
    store_places,
    with_changed,
)


def test_places_are_offered_again_by_hand(tmp_path: Path) -> None:
    store_places(tmp_path, "left", {"A/0": "hand", "B/0": "index_middle", "C/0": ""})
    store_places(tmp_path, "right", {"A/0": "forearm"})
    assert read_places(tmp_path, "left") == {"A/0": "hand", "B/0": "index_middle", "C/0": ""}
    assert read_places(tmp_path, "right") == {"A/0": "forearm"}


def test_a_segment_that_another_tracker_takes_is_no_longer_that_of_the_one_before(
    tmp_path: Path,
) -> None:
    store_places(tmp_path, "left", {"A/0": "hand", "B/0": "index_middle"})
    store_places(tmp_path, "left", {"D/0": "hand"})
    assert read_places(tmp_path, "left") == {"B/0": "index_middle", "D/0": "hand"}


def test_who_is_displaced_is_not_worn_any_more_even_where_the_page_does_not_know_it_yet() -> None:
    shown = [
        {"sensor": "A/0", "place": "hand"},
        {"sensor": "B/0", "place": ""},
    ]  # A by its firmware; B was put on a segment a moment ago
    changed = with_changed({"B/0": "index_middle"}, shown, {"C/0": "hand"})
    assert changed == {"A/0": "", "B/0": "index_middle", "C/0": "hand"}
    assert with_changed(changed, shown, {"A/0": "index_middle"})["B/0"] == ""


@pytest.mark.parametrize(
    "places",
    [
        {"A": "nose"},
        {"A": "hand", "B": "hand"},
        {"A" * 200: "hand"},
        {f"{k}": "" for k in range(65)},
    ],
    ids=["no segment", "two on one", "a long name", "too many"],
)
def test_what_cannot_be_is_refused_and_nothing_is_kept(
    places: dict[str, str], tmp_path: Path
) -> None:
    with pytest.raises(InputError):
        store_places(tmp_path, "left", places)
    assert not (tmp_path / FILE).exists()


@pytest.mark.parametrize("text", ["", "[]", '{"left": 3}', '{"left": {"A": "nose"}}', "\0"])
def test_a_file_that_cannot_be_read_offers_nothing(text: str, tmp_path: Path) -> None:
    (tmp_path / FILE).write_text(text)
    assert read_places(tmp_path, "left") == {}
