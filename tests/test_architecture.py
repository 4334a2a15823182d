"""The direction of the arrows, read from the imports of every module: app -> sessions -> estimators, and estimators is pure."""

import ast
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = (
    "handscope.validation",
    "handscope.app",
    "handscope.sessions",
    "handscope.estimators",
)  # each may import those behind it
NUMERICS = {"numba", "numpy", "scipy", "filterpy", "vqf"}
MACHINE = {
    "native_libraries": {"ctypes", "threadpoolctl", "threadpoolctl.threadpool_limits"},
    "optional_imports": {"importlib", "sys"},
    "translation.packaged_code": {"pathlib", "pathlib.Path"},
    "translation.translation_lock": {"os", "pathlib", "pathlib.Path", "threading"},
}  # of the estimators' numerics, what looks after numba and its neighbours
IMPURE = {
    *("time", "datetime", "calendar", "sched"),  # a clock
    *(
        "socket",
        "ssl",
        "http",
        "urllib",
        "select",
        "selectors",
        "asyncio",
        "smtplib",
        "ftplib",
        "socketserver",
    ),
    *(
        "os",
        "io",
        "pathlib",
        "shutil",
        "tempfile",
        "glob",
        "fileinput",
        "mmap",
        "sqlite3",
        "dbm",
        "zipfile",
        "tarfile",
        "gzip",
    ),
    *("random", "secrets", "uuid"),
    *(
        "logging",
        "warnings",
        "sys",
        "subprocess",
        "threading",
        "multiprocessing",
        "signal",
        "ctypes",
    ),
}
SKELETON = ("numerics", "hand")  # what a simulator may know besides itself
VALUES = ("data", "errors", "messages")
LEVELS = {  # a package imports packages of lower levels only
    "handscope.estimators": (
        *(
            "messages",
            "errors",
            "numerics",
            "hand",
            "data",
            "sensors magnet.model",
            "orientation force simulation photograph",
        ),
        *(
            "alignment magnet.array",
            "fault_detection finger_ekf magnet.tracker self_calibration",
            "magnet.pipeline measures",
            "pipeline",
            "methods",
            "recording_checks",
        ),
    ),
    "handscope.sessions": (
        "db tables_io sealing",
        "wire",
        "files",
        "motion_bids table_import",
        "formats",
        "exports",
        "clinic hand_photographs treatment assessment_plans",
        "wards gloves",
        "store",
        "login",
    ),
    "handscope.app": (
        "language protocols devices",
        "report photograph",
        "workers",
        "scene results",
        "exporting replay_file example_patients",
        "analysis",
        "live",
        "auth",
        "page_files",
        "api",
        "commands",
    ),
}
MOST_FILES = 17  # of a folder, its __init__.py among them
OF_ONE_KIND = {
    *("measures", "commands", "protocols", "versions"),  # each file is one more of the same
    "security",  # tests, a file for each section of the ASVS
}
VAGUE = {"utils", "util", "helpers", "helper", "manager", "managers", "common", "base", "misc"}
PRIVATE = {
    *("told", "heard", "said", "askew", "lively", "creep", "surprise", "mood", "way"),
    *("apart", "alike", "seat", "seats"),
}
PARTICIPLES = {"kept", "moved"}  # no function's name
LONGEST = 575  # lines
MODULES = sorted(
    p
    for room in (*ROOMS, "handscope", "tests")
    for p in (ROOT / room.removeprefix("handscope.")).rglob("*.py")
)


def _name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(
        parts if parts[0] in ("handscope", "tests") else ("handscope", *parts)
    ).removesuffix(".__init__")


def _in(package: str) -> list[Path]:
    return [p for p in MODULES if _is_within(_name(p), package)]


def _is_within(module: str, package: str) -> bool:
    return module == package or module.startswith(f"{package}.")


def imports(source: str | Path, package: str) -> Iterator[str]:
    """Full names of what a module imports, inside functions too: of `from a import b` both `a` and `a.b`."""
    nodes = ast.walk(ast.parse(source)) if isinstance(source, str) else nodes_of(source)
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")
            origin = ".".join(
                [
                    *(parts[: len(parts) - node.level + 1] if node.level else ()),
                    *filter(None, [node.module]),
                ]
            )
            yield origin
            yield from (f"{origin}.{alias.name}" for alias in node.names)


@cache
def nodes_of(path: Path) -> list[ast.AST]:
    """Of a module that several tests read."""
    return list(ast.walk(ast.parse(path.read_text())))


@cache
def _imports(path: Path) -> list[str]:
    name = _name(path)
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    return list(imports(path, package))


def _offenders(package: str, forbidden: tuple[str, ...]) -> list[str]:
    return [
        f"{_name(p)} imports {i}"
        for p in _in(package)
        for i in _imports(p)
        if any(_is_within(i, f) for f in forbidden)
    ]


def test_the_reader_of_imports_sees_every_form() -> None:
    source = (
        "import a.b\nfrom c import d\nfrom . import e\nfrom ..f import g\ndef h():\n    import i\n"
    )
    assert list(imports(source, "x.y")) == ["a.b", "c", "c.d", "x.y", "x.y.e", "x.f", "x.f.g", "i"]
    assert len(_in("handscope.estimators")) > 20


@pytest.mark.parametrize("room", ROOMS)
def test_imports_point_one_way(room: str) -> None:
    assert _offenders(room, ROOMS[: ROOMS.index(room)]) == []


@pytest.mark.parametrize("room", LEVELS)
def test_packages_import_lower_levels_only(room: str) -> None:
    """The modules of a room itself (a server, its settings) put the packages together and stand outside the levels."""
    level = {
        f"{room}.{package}": k
        for k, packages in enumerate(LEVELS[room])
        for package in packages.split()
    }

    def package(module: str) -> str | None:
        return next((p for p in level if _is_within(module, p)), None)

    inside = {_name(p) for p in _in(room) if p.parent != ROOT / room.removeprefix("handscope.")}
    assert [
        name
        for name in inside
        if not package(name) and not any(p.startswith(f"{name}.") for p in level)
    ] == []
    arrows = [(p, i, package(_name(p)), package(i)) for p in _in(room) for i in _imports(p)]
    assert [
        f"{_name(p)} imports {i}"
        for p, i, a, b in arrows
        if a and b and a != b and level[b] >= level[a]
    ] == []


def test_nothing_that_runs_imports_the_tests() -> None:
    assert [o for room in ROOMS for o in _offenders(room, ("tests",))] == []


def test_estimators_import_numerics_and_the_pure_part_of_the_standard_library_only() -> None:
    allowed = NUMERICS | (set(sys.stdlib_module_names) - IMPURE)
    outside = [
        (p, i)
        for p in _in("handscope.estimators")
        for i in _imports(p)
        if not _is_within(i, "handscope.estimators")
        and i not in MACHINE.get(_name(p).removeprefix("handscope.estimators.numerics."), ())
    ]
    assert [
        f"{_name(p)} imports {i}"
        for p, i in outside
        if i != "handscope" and i.split(".")[0] not in allowed
    ] == []


def test_estimators_neither_open_nor_print_nor_draw_from_a_hidden_generator() -> None:
    found = []
    for path in _in("handscope.estimators"):
        for node in nodes_of(path):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.func.id in ("open", "print", "input", "exec", "eval")
            ):
                found.append(f"{_name(path)}:{node.lineno} calls {node.func.id}")
            if (
                isinstance(node, ast.Attribute)
                and node.attr != "Generator"
                and ast.unparse(node.value) in ("np.random", "numpy.random")
            ):
                found.append(f"{_name(path)}:{node.lineno} uses {ast.unparse(node)}")
            if isinstance(node, ast.Attribute) and node.attr in (
                "tofile",
                "fromfile",
                "savetxt",
                "loadtxt",
                "genfromtxt",
                "memmap",
            ):
                found.append(f"{_name(path)}:{node.lineno} uses {ast.unparse(node)}")
    assert found == []


def test_a_simulator_knows_no_tracker() -> None:
    known = [f"handscope.estimators.{name}" for name in (*SKELETON, *VALUES, "simulation")]
    ours = [
        (p, i)
        for p in _in("handscope.estimators.simulation")
        for i in _imports(p)
        if i.startswith("handscope.estimators.")
    ]
    assert [
        f"{_name(p)} imports {i}" for p, i in ours if not any(_is_within(i, k) for k in known)
    ] == []


def test_no_estimator_knows_the_simulator() -> None:
    outside = [
        p
        for p in _in("handscope.estimators")
        if not _is_within(_name(p), "handscope.estimators.simulation")
    ]
    assert [
        f"{_name(p)} imports {i}"
        for p in outside
        for i in _imports(p)
        if _is_within(i, "handscope.estimators.simulation")
    ] == []


def test_modules_import_by_name_and_are_short() -> None:
    assert [_name(p) for p in MODULES if any(name.endswith(".*") for name in _imports(p))] == [], (
        "star import"
    )
    assert [_name(p) for p in MODULES if p.read_text().count("\n") > LONGEST] == [], (
        "name the second idea and move it out"
    )


def test_capabilities_and_options_are_typed_fields_and_sentences_are_not_read_back() -> None:
    asked = [
        f"{_name(p)}:{node.lineno}"
        for p in MODULES
        if "tests" not in p.parts
        for node in nodes_of(p)
        if isinstance(node, ast.Call) and _asks_at_run_time(node)
    ]
    assert asked == [], "give the method or its options a typed field and ask that"


def _asks_at_run_time(call: ast.Call) -> bool:
    name = call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")
    if name not in ("hasattr", "getattr", "startswith"):
        return False
    function, asked = ast.unparse(call.func), ast.unparse(call.args[0]) if call.args else ""
    if function == "hasattr":
        return asked in ("method", "module")
    if function == "getattr":  # with a default: the field may be absent
        return len(call.args) == 3 and asked.split(".")[-1] in ("method", "params")
    return function.endswith("source.startswith")


def test_names_say_what_is_inside() -> None:
    assert [
        str(p.relative_to(ROOT))
        for p in MODULES
        if VAGUE & {part.removesuffix(".py") for part in p.relative_to(ROOT).parts}
    ] == []


def test_identifiers_and_modules_use_the_words_of_the_field() -> None:
    """docs/glossary.md has the field's term for each private word."""
    assert [
        f"{_name(p)}: {name}"
        for p in MODULES
        if "tests" not in p.parts
        for name in (p.stem, *_identifiers(nodes_of(p)))
        if PRIVATE & set(name.lower().split("_"))
    ] == []
    assert [
        f"{_name(p)}: {node.name}"
        for p in MODULES
        if "tests" not in p.parts
        for node in nodes_of(p)
        if isinstance(node, ast.FunctionDef) and node.name.strip("_") in PARTICIPLES
    ] == []


def _identifiers(nodes: list[ast.AST]) -> set[str]:
    """Names of variables, arguments, attributes, functions and classes."""
    names = set()
    for node in nodes:
        match node:
            case ast.Name(id=name) | ast.arg(arg=name) | ast.Attribute(attr=name):
                names.add(name)
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
    return names


def test_folders_are_small_enough_to_be_looked_over() -> None:
    folders = {p.parent for p in MODULES if p.parent.name not in OF_ONE_KIND}
    assert [
        str(f.relative_to(ROOT)) for f in folders if len(list(f.glob("*.py"))) > MOST_FILES
    ] == []
