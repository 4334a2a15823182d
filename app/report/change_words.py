"""Changes in words: "more" and "less" of an angle in its own direction, never a bare plus or minus, which therapists read either way (words.py)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi
from typing import Literal

from handscope.app.language import Language
from handscope.app.report.changes import Change, Changes
from handscope.app.report.content import Task
from handscope.app.report.progress.labels import label
from handscope.app.report.sections.range_rows import RangeRow
from handscope.app.report.units import DEG, PACE, directed, directions_of, places_of, with_unit
from handscope.app.report.words import (
    ROTATION,
    SIDES,
    extension_words,
    flexion_words,
    side_words,
)
from handscope.estimators.hand.anatomy import DOF_NAMES
from handscope.estimators.measures.range_of_motion import Range

End = Literal["smallest", "largest"]
ENDS: tuple[tuple[End, int], ...] = (
    ("smallest", -1),
    ("largest", 1),
)  # and the direction in which it is more
MORE, LEVEL = ("more", "less"), ("higher", "lower")
LISTED = 10  # changes within the MDC at most that the print lists; of more it tells how many, so that a report stays a page
NAMED = 4  # changes that are not judged at most that the print names


@dataclass(frozen=True)
class _ChangeWords:
    """A change with what of whom it is: "Index MCP", "flexion"."""

    joint: str
    what: str
    change: Change
    words: str  # "8° more"
    unchanged: bool


def row_words(
    found: Changes, tasks: Sequence[Task], row: RangeRow, language: Language
) -> dict[str, str]:
    """For the cells flexion, extension and sideways of a row: "8° more, beyond MDC 12°"; "" where there is nothing to compare with."""
    cells: dict[str, list[str]] = {"flexion": [], "extension": [], "sideways": []}
    for cell, side, c, sign in _ends(found, tasks, row):
        cells[cell].append(f"{side_words(side, language)} {_words(c, sign, language)}".strip())
    return {cell: language.several(words) for cell, words in cells.items()}


def row_ends(
    found: Changes, tasks: Sequence[Task], row: RangeRow, language: Language
) -> dict[str, str]:
    """Of flexion and extension of a row what changed beyond the MDC: "8° more"."""
    return {
        cell: _which(c, sign, language)[0]
        for cell, _, c, sign in _ends(found, tasks, row)
        if cell != "sideways" and c.beyond
    }


def range_changes(
    found: Changes, tasks: Sequence[Task], rows: Sequence[RangeRow], language: Language
) -> str:
    """All rows in one paragraph, what is beyond the MDC first; "" where none has a change."""
    worded = [
        _ChangeWords(
            f"{row.group} {row.joint}".strip(),
            side_words(side, language) or language.say(f"cell.{cell}"),
            c,
            *_which(c, sign, language),
        )
        for row in rows
        for cell, side, c, sign in _ends(found, tasks, row)
    ]
    return _paragraph(found, worded, found.sources("range_of_motion"), language)


def tapping_changes(found: Changes, tasks: Sequence[Task], language: Language) -> str:
    """The same of the means over the trials of tapping."""
    names = {t.result.task for t in tasks}
    worded = [
        _ChangeWords("", language.say(f"figure.{c.name}"), c, *_which(c, 1, language, LEVEL))
        for c in found.each
        if c.measure == "tapping" and c.task in names and language.known(f"figure.{c.name}", "")
    ]
    shown = found.sources("range_of_motion")
    return _paragraph(
        found,
        worded,
        [sentence for sentence in found.sources("tapping") if sentence not in shown],
        language,
    )


def tapping_words(found: Changes, language: Language) -> dict[str, list[tuple[Change, str]]]:
    """By task the mean of the trials then and now: "0.40 per s higher, within MDC"; what is beyond it first, what is not judged last."""
    words: dict[str, list[tuple[Change, str]]] = {}
    for c in sorted(found.each, key=lambda c: (not c.beyond, c.mdc95 is None)):
        if c.measure == "tapping":
            words.setdefault(c.task, []).append((c, _words(c, 1, language, LEVEL)))
    return words


def level_words(change: Change, language: Language) -> str:
    """A change of a size: "0.40 per s higher, within MDC"; of an angle in its own direction, "8° more, within MDC"."""
    sign, more = _direction(change)
    return _words(change, sign, language, more)


def size_words(c: Change, language: Language) -> str:
    """A change of a size alone: "0.40 per s higher"."""
    sign, more = _direction(c)
    return _which(c, sign, language, more)[0]


def named_change(c: Change, language: Language) -> str:
    """A figure and its change: "Index PIP, flexion 8° more"."""
    sign, more = _direction(c)
    return f"{label(c.name, language)} {_which(c, sign, language, more)[0]}"


def _direction(c: Change) -> tuple[int, tuple[str, str]]:
    """The sign of a change that is more, and the words for more and less."""
    end = c.name.rpartition("_")[2] if c.measure == "range_of_motion" else ""
    return (-1 if end == "min" else 1), (MORE if end in ("min", "max") else LEVEL)


def value_words(name: str, value: float, unit: str, language: Language) -> str:
    """A value without a bare sign: of an angle the direction stands in the figure's name, of anything else below zero it is said."""
    joint, _, end = name.rpartition("_flexion_")
    if joint and unit == "deg":
        rad = value / DEG
        return (
            extension_words(joint, rad, pi, language)
            if end == "min"
            else flexion_words(rad, language)
        )
    size, (angle, _, end) = amount(abs(value), name, unit, language), name.rpartition("_")
    is_nothing = size == amount(0.0, name, unit, language)
    if angle in DOF_NAMES:
        joint, _, turn = angle.rpartition("_")
        ways = ROTATION if turn == "pronation" else SIDES[joint]
        opposite = not is_nothing and (value < 0) != (end == "min")
        return f"{size} {side_words(ways[value > 0], language)}" if opposite else size
    return size if is_nothing else directed(name, value, size, language)


def amount(value: float, name: str, unit: str, language: Language) -> str:
    """A size in the unit a person reads: "8°", "0.40 per s"."""
    return with_unit(language.number(value, places_of(name, value, unit)), unit, language)


def _paragraph(
    found: Changes, worded: Sequence[_ChangeWords], sources: Sequence[str], language: Language
) -> str:
    """Of joints, what of them, changes and their words; an MDC that is not the published one, which the sources tell, stands with its change."""
    if not worded:
        return ""
    groups: dict[str, dict[str, list[str]]] = {"beyond": {}, "within": {}, "unjudged": {}}
    for s in worded:
        c = s.change
        own = c.basis in ("own", "glove") and c.mdc95 is not None
        mdc95 = (
            f" ({language.say(f'mdc.{c.basis}', size=_size(c.mdc95 or 0.0, c, language))})"
            if own
            else ""
        )
        if not s.unchanged or c.beyond:
            group = groups["unjudged" if c.mdc95 is None else "beyond" if c.beyond else "within"]
            group.setdefault(s.joint, []).append(f"{s.what} {s.words}{mdc95}")
    beyond, within, unjudged = (
        language.several(f"{joint} {', '.join(all_)}".strip() for joint, all_ in g.items())
        for g in groups.values()
    )
    inside = [s for s in worded if s.change.mdc95 is not None and not s.change.beyond]
    if len(inside) > LISTED:
        within = (
            language.counted("changes.all_others", len(inside))
            if beyond
            else language.say("changes.all", count=len(inside))
        )
    open_ = sum(map(len, groups["unjudged"].values()))
    if open_ > NAMED:
        unjudged = language.counted("trust.figures", open_)
    listed = sum(len(all_) for group in groups.values() for all_ in group.values())
    return " ".join(
        [
            language.say(
                "changes.beyond",
                day=language.day(found.since),
                hour=language.hour(found.since),
                what=beyond or language.say("changes.nothing"),
            ),
            *([language.say("changes.within", what=within)] if within else []),
            *([language.say("changes.unjudged", what=unjudged)] if unjudged else []),
            *(
                [language.say("changes.rest")]
                if listed < len(worded) and len(inside) <= LISTED
                else []
            ),
            *map(language.translate, sources),
        ]
    )


def _ends(
    found: Changes, tasks: Sequence[Task], row: RangeRow
) -> Iterator[tuple[str, str, Change, int]]:
    """Of both ends of a row's ranges: cell, side ("" for flexion), change, and the sign in which it is more."""
    for r in row.ranges:
        flexion = r.angle == "flexion"
        sides = ("", "") if flexion else ROTATION if r.angle == "pronation" else SIDES[r.joint]
        for (end, sign), cell, side in zip(
            ENDS, ("extension", "flexion") if flexion else ("sideways", "sideways"), sides
        ):
            if c := _at(found, tasks, r, end):
                yield cell, side, c, sign


def _at(found: Changes, tasks: Sequence[Task], r: Range, end: End) -> Change | None:
    """The change of that end in the task in which the range's end was reached."""
    value = getattr(r, end)
    for task in tasks:
        if task.asks(r.joint, r.angle) and any(
            (d.joint, d.angle, getattr(d, end)) == (r.joint, r.angle, value)
            for d in task.result.details
        ):
            return found.of(
                task.result.task, f"{r.joint}_{r.angle}_{'max' if end == 'largest' else 'min'}"
            )
    return None


def _words(c: Change, sign: int, language: Language, more: tuple[str, str] = MORE) -> str:
    """The change in the direction `sign`, and how it compares with the MDC."""
    which, unchanged = _which(c, sign, language, more)
    if c.mdc95 is None or (unchanged and not c.beyond):
        return which
    if c.basis == "published" and not c.beyond:
        return language.say("change.within", which=which)  # how much that is stands below the table
    mdc95 = language.say(f"mdc.{c.basis}", size=_size(c.mdc95, c, language))
    return language.say("change.beyond" if c.beyond else "change.within_of", which=which, mdc=mdc95)


def _which(
    c: Change, sign: int, language: Language, more: tuple[str, str] = MORE
) -> tuple[str, bool]:
    """ "8° more", and whether there is no change to be seen."""
    size, nothing = (_size(v, c, language) for v in (abs(c.value), 0.0))
    if size == nothing:
        return language.say("change.none"), True
    above, below = PACE[::-1] if directions_of(c.name) == PACE else more
    return language.say(f"change.{above if sign * c.value > 0 else below}", size=size), False


def _size(value: float, c: Change, language: Language) -> str:
    return amount(value, c.name, c.unit, language)
