"""Pages of the site that are made from the program itself: command line, options, HTTP interface, package reference, list of measured pages.

Read by mkdocs (`hooks` in mkdocs.yml). A page made here is never edited.
"""

import json
import re
from collections.abc import Iterator
from inspect import ismodule
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mkdocs.structure.files import File, Files

DOCS = Path(__file__).resolve().parents[1]


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages to those that are written."""
    from handscope.app.cli import VERBS

    pages = {
        "reference/command-line.md": command_line(VERBS),
        "reference/options.md": options(),
        "reference/http.md": http(),
        "reference/python.md": python(),
        "validation/index.md": validation(),
        "tutorials/first-analysis.md": notebook("analyse_a_recording"),
    }
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Links to files of the repository that are no pages become their paths."""
    path = r"\[([^\]]+)\]\((?:(?:\.\./)+((?:firmware|static|tests|[A-Z]+\.)[^)]*)|((?:\.\./)*(?:examples|decisions)/[^)]*\.py))\)"
    return re.sub(
        path, lambda m: f"{m[1]} (`{m[2] or 'docs/' + m[3].replace('../', '')}`)", markdown
    )


def notebook(name: str) -> str:
    """Words and code of a notebook; tests/app/analysis/test_notebooks.py runs it."""
    kept = json.loads((DOCS / "notebooks" / f"{name}.ipynb").read_text("utf-8"))
    parts = []
    for cell in kept["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
    parts.append(f"All of it as a notebook that runs: [{name}.ipynb](../notebooks/{name}.ipynb).")
    return "\n\n".join(parts) + "\n"


def command_line(verbs: dict[str, str]) -> str:
    """`handscope VERB --help` of every verb."""
    parts = ["# Command line\n\nWhat `handscope VERB --help` says.\n"]
    for verb, meaning in verbs.items():
        parts.append(
            f"## {verb}\n\n{meaning[0].upper()}{meaning[1:]}.\n\n```text\n{_help(verb)}\n```\n"
        )
    return "\n".join(parts)


def _help(verb: str) -> str:
    """The help of a verb without the description that stands above it."""
    import contextlib
    import io

    from handscope.app.cli import main

    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        main([verb, "--help"])
    return text.getvalue().strip()


def options() -> str:
    """Options of every method, as their declarations have them."""
    from handscope.estimators.data.options import describe
    from handscope.estimators.methods import ALL_METHODS

    parts = [
        "# Options of the methods\n\n`handscope process RECORDING --method NAME --option KEY=VALUE`.\n"
    ]
    for name, method in ALL_METHODS.items():
        parts.append(
            f"## {name}\n\n{method.TITLE}.\n\n| option | default | unit | meaning | source |\n|---|---|---|---|---|"
        )
        parts.extend(
            f"| `{o.name}` | {_cell(o.default)} | {_cell(o.unit)} | {_cell(o.meaning)} | {_cell(o.source)} |"
            for o in describe(method.Params)
        )
        parts.append("")
    return "\n".join(parts)


def http() -> str:
    """Routes of the HTTP interface from its OpenAPI description."""
    from handscope.app.server import create_app
    from handscope.app.settings import Settings

    with TemporaryDirectory() as folder:
        schema = create_app(Settings(data=Path(folder))).openapi()
    parts = [
        "# HTTP interface: every route\n\nGenerated from the server's OpenAPI description. How to log in and what to expect: [HTTP API](../http-api.md).\n"
    ]
    parts.append("| route | | what |\n|---|---|---|")
    parts.extend(sorted(_routes(schema)))
    return "\n".join(parts) + "\n"


def _routes(schema: dict[str, Any]) -> Iterator[str]:
    for path, methods in schema["paths"].items():
        for method, operation in methods.items():
            text = operation.get("description") or operation.get("summary", "")
            yield f"| `{path}` | {method.upper()} | {_cell(text.splitlines()[0] if text else '')} |"


def python() -> str:
    """What a script may call."""
    import handscope

    things = (getattr(handscope, name) for name in handscope.__all__)
    paths = (t.__name__ if ismodule(t) else f"{t.__module__}.{t.__qualname__}" for t in things)
    blocks = "\n\n".join(f"::: {path}" for path in paths)
    return (
        "# Python\n\n`import handscope as hs`: the functions are `hs.load`, `hs.process`, ...\n\n"
        f"{blocks}\n\n## What they return\n\n::: handscope.app.analysis.recording\n\n::: handscope.app.analysis.movement\n\n"
        "::: handscope.app.analysis.result\n"
    )


def validation() -> str:
    """The measured pages, and which reproductions have none here."""
    from handscope.validation.reproduce import REPRODUCTIONS

    intro = (DOCS / "site" / "validation.md").read_text()
    rows = ["| | what | measured |", "|---|---|---|"]
    for name, meaning in REPRODUCTIONS.items():
        page = DOCS / "validation" / f"{name}.md"
        found = re.search(r"on (\d{4}-\d\d-\d\d)", page.read_text()) if page.is_file() else None
        link = f"[{name}]({name}.md)" if found else f"`{name}`"
        rows.append(
            f"| {link} | {_cell(meaning)} | {found[1] if found else 'no page yet: run the command'} |"
        )
    return intro + "\n" + "\n".join(rows) + "\n"


def _cell(value: object) -> str:
    """A value in one cell of a table."""
    text = value if isinstance(value, str) else json.dumps(value)
    return text.replace("|", "\\|").replace("\n", " ").replace("<", "&lt;")
