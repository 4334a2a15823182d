"""Findings as a person reads them: on a terminal, and as Markdown, a page each."""

import textwrap
from collections.abc import Iterator, Sequence

from handscope.validation.reproduce.finding import Finding, Row, Sizes, Spread, Table, at_or_below

WIDTH = 140


def as_text(finding: Finding) -> str:
    """For a terminal."""
    parts = [
        f"{finding.title}\n{'=' * len(finding.title)}",
        *(textwrap.fill(s, WIDTH) for s in finding.setting),
    ]
    for table in finding.tables:
        parts.append(f"{table.title}{_how(table)}\n{_align_columns(_grid(table))}")
    text = [*(verdict.words for verdict in finding.verdicts), *finding.remarks]
    parts.append("\n".join(textwrap.fill(s, WIDTH) for s in text))
    return "\n\n".join(part for part in parts if part) + "\n"


def as_markdown(finding: Finding, images: str | None) -> str:
    """A section of a page; `images` is where its figures lie, seen from the page; None leaves them out."""
    text = "\n".join(f"- {s}" for s in (*(v.words for v in finding.verdicts), *finding.remarks))
    tables = [
        f"{table.title}{_how(table)}:\n\n{_markdown_table(_grid(table))}"
        for table in finding.tables
    ]
    figures = [f"![{finding.title}]({images}/{name})" for name in finding.figures if images]
    return "\n\n".join(
        part for part in (f"## {finding.title}", *finding.setting, *tables, text, *figures) if part
    )


def sizes_as_text(sizes: Sizes) -> str:
    """For a terminal; without the sources, which the page has."""
    text = "; ".join(f"{what} {size}" for what, size, *_ in sizes.rows)
    return f"{sizes.title}\n{'=' * len(sizes.title)}\n\n{textwrap.fill(text, WIDTH)}\n"


def sizes_as_markdown(sizes: Sizes) -> str:
    """A section of a page."""
    return f"## {sizes.title}\n\n{_markdown_table([list(sizes.head), *(list(row) for row in sizes.rows)], right=False)}"


def as_page(section: str, written: str) -> str:
    """A page of the site from a section: its title first, then who wrote it and when."""
    title, _, rest = section.partition("\n")
    return f"# {title.lstrip('# ')}\n\n*{written}*\n{rest}\n"


def _how(table: Table) -> str:
    many = any(s.count > 1 for row in table.rows for s in row.ours.values())
    return f"; mean ± standard deviation over the {table.over} (largest)" if many else ""


def _grid(table: Table) -> list[list[str]]:
    """Cells of a table, its head first; behind a column the paper's figures where it has any."""
    with_paper = [c for c in table.columns if any(c in row.theirs for row in table.rows)]
    head = [
        table.head,
        *(cell for c in table.columns for cell in ([c, "paper"] if c in with_paper else [c])),
    ]
    grid = [head + ([f"{table.judged} at or below the paper"] if table.judged else [])]
    for row in table.rows:
        cells = [row.name, *_cells(table, row, with_paper)]
        if table.judged:
            cells.append({True: "yes", False: "NO", None: "-"}[at_or_below(row, table.judged)])
        grid.append(cells)
    return grid


def _cells(table: Table, row: Row, with_paper: Sequence[str]) -> Iterator[str]:
    for column in table.columns:
        yield _number(row.ours[column], table.digits) if column in row.ours else "-"
        if column in with_paper:
            yield _theirs(row, column) if column in row.theirs else "-"


def _theirs(row: Row, column: str) -> str:
    mean = f"{row.theirs[column]:.1f}"
    return f"{mean} ± {row.theirs_sd[column]:.1f}" if column in row.theirs_sd else mean


def _number(s: Spread, digits: int) -> str:
    return (
        f"{s.mean:.{digits}f} ± {s.sd:.{digits}f} ({s.worst:.{digits}f})"
        if s.count > 1
        else f"{s.mean:.{digits}f}"
    )


def _align_columns(grid: Sequence[Sequence[str]]) -> str:
    widths = [max(len(cell) for cell in column) for column in zip(*grid)]
    return "\n".join(
        "  ".join([cells[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(cells[1:], widths[1:]))])
        for cells in grid
    )


def _markdown_table(grid: Sequence[Sequence[str]], right: bool = True) -> str:
    head, *rows = (f"| {' | '.join(cells)} |" for cells in grid)
    return "\n".join([head, f"|---{('|---:' if right else '|---') * (len(grid[0]) - 1)}|", *rows])
