"""The report as PDF: words and figures go to the layout as data, so any text prints literally; the same content gives the same bytes.

Tagged and archivable (PDF/A-2a, PDF/UA-1, as far as the compiler checks: it refuses an image without a description); its own fonts only.
"""

import json
import re
from pathlib import Path
from typing import Any, Final

import typst

from handscope.app.language import Language
from handscope.app.report.content import Content
from handscope.app.report.page import words_of

LAYOUT = Path(__file__).with_name("report.typ")
STANDARDS: Final = ("a-2a", "ua-1")
UNPRINTABLE = re.compile(r'the text (?:contains the disallowed codepoint )?`"(.+?)"`')
ESCAPED = re.compile(r"\\u\{([0-9a-f]+)\}")


def pdf(content: Content, language: Language, paper: str = "a4") -> bytes:
    """The report; a character that the fonts lack is printed by its number, as [U+4E2D]."""
    moment = int(content.date.timestamp()) if content.date else 0
    return pdf_of(words_of(content, language), LAYOUT, paper, moment)


def pdf_of(page: Any, layout: Path, paper: str, moment: int) -> bytes:
    """A page's words and figures in their layout, dated `moment` (s since 1970, UTC)."""
    missing = set[str]()
    while True:
        try:
            return _compile(_spell(page, missing), layout, paper, moment)
        except typst.TypstError as problem:
            found = _unprintable(problem)
            if found is None or found in missing:
                raise
            missing.add(found)


def _compile(page: Any, layout: Path, paper: str, moment: int) -> bytes:
    compiler = typst.Compiler(
        layout,
        root=layout.parent,
        font_paths=typst.Fonts(include_system_fonts=False),
        sys_inputs={"page": json.dumps(page), "paper": paper},
    )
    made = compiler.compile(format="pdf", pdf_standards=[*STANDARDS], timestamp=moment)
    assert isinstance(made, bytes)
    return made


def _unprintable(problem: typst.TypstError) -> str | None:
    """The character that the compiler cannot print, if that is its complaint."""
    found = UNPRINTABLE.search(problem.message)
    if not found:
        return None
    escaped = ESCAPED.fullmatch(found[1])
    return chr(int(escaped[1], 16)) if escaped else found[1]


def _spell(value: Any, missing: set[str]) -> Any:
    """The page with every missing character replaced by its number."""
    if isinstance(value, dict):
        return {key: _spell(v, missing) for key, v in value.items()}
    if isinstance(value, list):
        return [_spell(v, missing) for v in value]
    if isinstance(value, str) and missing:
        return "".join(f"[U+{ord(c):04X}]" if c in missing else c for c in value)
    return value
