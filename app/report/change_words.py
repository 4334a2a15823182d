"""Changes in words: "more" and "less" of an angle in its own direction, never a bare plus or minus, which therapists read either way (words.py)."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

from app.report.changes import Change, Changes
from app.report.content import Task
from app.report.range_rows import RangeRow
from app.report.words import ROTATION, SIDES
from estimators.measures.range_of_motion import Range

End = Literal["smallest", "largest"]
ENDS: tuple[tuple[End, int], ...] = (("smallest", -1), ("largest", 1))  # and the direction in which it is more
UNCHANGED, MORE, LEVEL = "unchanged", ("more", "less"), ("higher", "lower")
LISTED = 10  # changes within the MDC at most that the print lists; of more it tells how many, so that a report stays a page
BASIS = {"own": "the patient's own MDC", "glove": "this glove's MDC", "published": "MDC"}
DECIMALS = {"deg": 0, "per s": 2, "s": 3, "%": 1, "mm": 1, "mm/s": 0, "": 1}


def row_words(found: Changes, tasks: Sequence[Task], row: RangeRow) -> dict[str, str]:
    """For the cells flexion, extension and sideways of a row: "8° more, beyond MDC 12°"; "" where there is nothing to compare with."""
    cells: dict[str, list[str]] = {"flexion": [], "extension": [], "sideways": []}
    for cell, side, c, sign in _ends(found, tasks, row):
        cells[cell].append(f"{side} {_words(c, sign)}".strip())
    return {cell: "; ".join(said) for cell, said in cells.items()}


def range_changes(found: Changes, tasks: Sequence[Task], rows: Sequence[RangeRow]) -> str:
    """All rows in one paragraph, what is beyond the MDC first; "" where none has a change."""
    said = [
        (f"{row.group} {row.joint}".strip(), side or cell, c, _which(c, sign))
        for row in rows
        for cell, side, c, sign in _ends(found, tasks, row)
    ]
    return _paragraph(found, said, found.sources("range_of_motion"))


def tapping_changes(found: Changes, tasks: Sequence[Task], labels: Mapping[str, tuple[str, int]]) -> str:
    """The same of the means over the trials of tapping."""
    names = {t.result.task for t in tasks}
    said = [("", labels[c.name][0].lower(), c, _which(c, 1, LEVEL)) for c in found.each if c.measure == "tapping" and c.task in names]
    told = found.sources("range_of_motion")
    return _paragraph(found, said, [sentence for sentence in found.sources("tapping") if sentence not in told])


def tapping_words(found: Changes) -> dict[str, dict[str, str]]:
    """By task and figure, the mean of the trials then and now: "0.40 per s higher, within MDC"."""
    words: dict[str, dict[str, str]] = {}
    for c in found.each:
        if c.measure == "tapping":
            words.setdefault(c.task, {})[c.name] = _words(c, 1, LEVEL)
    return words


def since_words(found: Changes) -> str:
    """The day of the session before: "12 May 2026"."""
    return f"{found.since.day} {found.since:%B %Y}"


def _paragraph(found: Changes, said: Sequence[tuple[str, str, Change, str]], sources: Sequence[str]) -> str:
    """Of joints, what of them, changes and their words; an MDC that is not the published one, which the sources tell, stands with its change."""
    if not said:
        return ""
    groups: dict[str, dict[str, list[str]]] = {"beyond": {}, "within": {}, "unjudged": {}}
    for joint, what, c, which in said:
        mdc95 = f" ({BASIS[c.basis]} {_amount(c.mdc95, c)})" if c.basis in ("own", "glove") and c.mdc95 is not None else ""
        if which != UNCHANGED or c.beyond:
            group = groups["unjudged" if c.mdc95 is None else "beyond" if c.beyond else "within"]
            group.setdefault(joint, []).append(f"{what} {which}{mdc95}")
    beyond, within, unjudged = ("; ".join(f"{joint} {', '.join(all_)}".strip() for joint, all_ in g.items()) for g in groups.values())
    inside = [c for _, _, c, _ in said if c.mdc95 is not None and not c.beyond]
    if len(inside) > LISTED:
        within = f"all {len(inside)} others" if beyond else f"all {len(inside)}"
    told = sum(len(all_) for group in groups.values() for all_ in group.values())
    return " ".join(
        [
            f"Since {since_words(found)}, beyond what repeated measurement gives (MDC95): {beyond or 'nothing'}.",
            *([f"Within it: {within}."] if within else []),
            *([f"Not judged: {unjudged}."] if unjudged else []),
            *(["All others unchanged."] if told < len(said) and len(inside) <= LISTED else []),
            *sources,
        ]
    )


def _ends(found: Changes, tasks: Sequence[Task], row: RangeRow) -> Iterator[tuple[str, str, Change, int]]:
    """Of both ends of a row's ranges: cell, side ("" for flexion), change, and the sign in which it is more."""
    for r in row.ranges:
        flexion = r.angle == "flexion"
        sides = ("", "") if flexion else ROTATION if r.angle == "pronation" else SIDES[r.joint]
        for (end, sign), cell, side in zip(ENDS, ("extension", "flexion") if flexion else ("sideways", "sideways"), sides):
            if c := _at(found, tasks, r, end):
                yield cell, side, c, sign


def _at(found: Changes, tasks: Sequence[Task], r: Range, end: End) -> Change | None:
    """The change of that end in the task in which the range's end was reached."""
    value = getattr(r, end)
    for task in tasks:
        if task.asks(r.joint, r.angle) and any(
            (d.joint, d.angle, getattr(d, end)) == (r.joint, r.angle, value) for d in task.result.details
        ):
            return found.of(task.result.task, f"{r.joint}_{r.angle}_{'max' if end == 'largest' else 'min'}")
    return None


def _words(c: Change, sign: int, more: tuple[str, str] = MORE) -> str:
    """The change in the direction `sign`, and how it compares with the MDC."""
    which = _which(c, sign, more)
    if c.mdc95 is None or (which == UNCHANGED and not c.beyond):
        return which
    if c.basis == "published" and not c.beyond:
        return f"{which}, within MDC"  # how much that is stands below the table
    return f"{which}, {'beyond' if c.beyond else 'within'} {BASIS[c.basis]} {_amount(c.mdc95, c)}"


def _which(c: Change, sign: int, more: tuple[str, str] = MORE) -> str:
    size, nothing = (_amount(v, c) for v in (abs(c.value), 0.0))
    return UNCHANGED if size == nothing else f"{size} {more[0] if sign * c.value > 0 else more[1]}"


def _amount(value: float, c: Change) -> str:
    number = f"{value:.{2 if c.name.endswith('_slope') else DECIMALS.get(c.unit, 2)}f}"
    return f"{number}°" if c.unit == "deg" else f"{number} {c.unit}".strip()
