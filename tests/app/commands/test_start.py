"""What a verb imports before it does anything: nothing heavy that it does not use. Read from the source, so that no program is started."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from handscope.app.cli import EVIDENCE, MODULES, VERBS
from handscope.app.commands import method_arguments, method_help

ROOT = Path(__file__).parents[3]
HEAVY = (  # each takes 30 ms and more to import
    *("babel", "distributed", "fastapi", "jinja2", "matplotlib", "mcap", "numba", "numpy"),
    *("pandas", "pyarrow", "requests", "scipy.interpolate", "scipy.linalg", "scipy.ndimage"),
    *("scipy.optimize", "scipy.signal", "scipy.spatial", "scipy.special", "scipy.stats"),
    *("serialx", "sqlalchemy", "tqdm", "typst", "uvicorn", "viser", "vqf"),
    "handscope.estimators.magnet.tracker",
)


@cache
def imported_by(module: str) -> frozenset[str]:
    """Names of what a module of ours imports when it is imported itself."""
    path = ROOT.joinpath(*module.split(".")[1:])
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    if not file.is_file():
        return frozenset()
    package = module if path.is_dir() else module.rpartition(".")[0]
    return frozenset(_at_import(ast.parse(file.read_text("utf-8")).body, package))


def _at_import(statements: list[ast.stmt], package: str) -> Iterator[str]:
    for statement in statements:
        match statement:
            case ast.Import(names=names):
                yield from (name.name for name in names)
            case ast.ImportFrom(module=source, names=names, level=level):
                base = package if level else source or ""
                yield base
                yield from (f"{base}.{name.name}" for name in names)
            case ast.If(test=ast.Name(id="TYPE_CHECKING")) | ast.FunctionDef():
                pass
            case ast.If() | ast.Try() | ast.With() | ast.ClassDef():
                yield from _at_import(
                    [n for n in ast.iter_child_nodes(statement) if isinstance(n, ast.stmt)], package
                )


def heavy_of(module: str) -> set[str]:
    """The heavy packages that importing a module of ours imports."""
    seen, waiting = set[str](), {module}
    while waiting:
        name = waiting.pop()
        seen.add(name)
        parents = {name.rsplit(".", k)[0] for k in range(1, name.count(".") + 1)}
        more = imported_by(name) if name.startswith("handscope.") else frozenset[str]()
        waiting |= (parents | more) - seen
    return {heavy for heavy in HEAVY if heavy in seen}


OFFICE = {"numba", "numpy", "sqlalchemy"}  # of verbs of a data folder: results are read and written
OFFLINE = {"mcap", "numba", "numpy", "scipy.interpolate", "scipy.special", "vqf"}
FIGURES = OFFLINE | {"babel", "scipy.ndimage", "scipy.signal", "scipy.spatial"}
SIMULATED = {"numba", "numpy", "scipy.interpolate", "scipy.optimize", "scipy.special"}
MAY = {  # what each other verb may import; nothing heavy where it is not here
    **dict.fromkeys(("account", "ward", "audit"), OFFICE),
    "data-key": OFFICE | {"mcap"},
    **dict.fromkeys(("assess", "export"), FIGURES),
    **dict.fromkeys(("record", "doctor"), OFFLINE | {"serialx"}),
    **dict.fromkeys(("glove", "samples"), SIMULATED | {"mcap"}),
    "compare": FIGURES | {"scipy.optimize"},
    "simulate": SIMULATED | {"scipy.signal"},
    "calibrate-strip": OFFLINE | {"scipy.optimize", "serialx"},
    "calibrate-force": {"numba", "numpy", "serialx"},
    "pose-sheet": {"babel", "numba", "numpy", "scipy.special", "typst"},
    "photograph": {"numba", "numpy", "scipy.optimize", "scipy.special"},
    "locate": OFFLINE | {"scipy.optimize"},
    "learn-magnet": OFFLINE | {"handscope.estimators.magnet.tracker"},
    "import": {"mcap", "numba", "numpy", "scipy.ndimage", "vqf"},
    "bench": {"numpy"},
    "reproduce": OFFLINE | {"scipy.optimize"},
}


@pytest.mark.parametrize("verb", sorted(VERBS))
def test_a_verb_imports_nothing_heavy_that_it_does_not_use(verb: str) -> None:
    room = "validation" if verb in EVIDENCE else "app"
    name = MODULES.get(verb, verb.replace("-", "_"))
    assert sorted(heavy_of(f"handscope.{room}.commands.{name}") - MAY.get(verb, set())) == []


def test_processing_imports_nothing_heavy_that_it_does_not_use() -> None:
    assert sorted(heavy_of("handscope.app.commands.methods") - OFFLINE) == []


def test_the_help_of_methods_is_what_the_methods_say() -> None:
    """Kept in a file: made again by `python -P -m handscope.app.commands.method_help > app/commands/method_help.json`."""
    kept = ROOT / "app" / "commands" / method_arguments.HELP
    assert kept.read_text("utf-8") == method_help.text()


def test_the_command_line_itself_imports_nothing_heavy() -> None:
    assert heavy_of("handscope.app.cli") == set()
