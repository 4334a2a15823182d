"""What a script may call says what it takes and gives: every parameter, shapes, units, errors and where it is from."""

import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

import griffe
import pytest

import handscope
from handscope.app.analysis.movement import Movement
from handscope.app.analysis.recording import AnalysisRecording
from handscope.app.analysis.result import Result

CLASSES = (AnalysisRecording, Movement, Result)  # what the functions return
UNIT = re.compile(r"\b(s|rad|rad/s|deg|mm|m|m/s\^2|T|SI)\b")
ARRAYS = ("t", "gyr", "acc", "mag")


def test_only_public_names_are_listed() -> None:
    assert dir(handscope) == sorted(handscope.__all__)


def functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Exported functions, and public functions of an exported module that are named by it."""
    for name in handscope.__all__:
        thing = getattr(handscope, name)
        if inspect.isfunction(thing):
            yield name, thing
        elif inspect.ismodule(thing):
            yield from ((f"{name}.{n}", f) for n, f in vars(thing).items() if inspect.isfunction(f))


def methods() -> Iterator[tuple[str, Callable[..., Any]]]:
    for kind in CLASSES:
        for name, method in vars(kind).items():
            if not name.startswith("_"):
                yield f"{kind.__name__}.{name}", method


def sections(function: Callable[..., Any]) -> dict[str, Any]:
    """The sections of a docstring by their kind; notes and warnings are texts of their own."""
    parsed = griffe.parse_numpy(griffe.Docstring(inspect.getdoc(function) or ""), warnings=False)
    return {str(s.title or s.kind.value).lower(): s.value for s in parsed}


def names_of(section: list[Any]) -> list[str]:
    return [name.lstrip("*") for one in section for name in one.name.split(", ")]


@pytest.mark.parametrize(("name", "function"), [*functions(), *methods()])
def test_a_public_function_says_what_it_takes_and_gives(
    name: str, function: Callable[..., Any]
) -> None:
    said, signature = sections(function), inspect.signature(function)
    taken = [p for p in signature.parameters if p != "self"]
    assert names_of(said.get("parameters", [])) == taken
    gives = signature.return_annotation not in (None, "None")
    assert ("returns" in said or "yields" in said) == gives
    if "raise InputError" in inspect.getsource(function):
        assert "raises" in said
    described = {n: p.description for p in said.get("parameters", []) for n in names_of([p])}
    for array in (p for p in ARRAYS if p in described):
        assert "(n" in described[array]


@pytest.mark.parametrize(("name", "function"), [*functions()])
def test_an_exported_function_names_errors_units_and_source(
    name: str, function: Callable[..., Any]
) -> None:
    text = inspect.getdoc(function) or ""
    assert "raises" in sections(function)
    assert "docs/" in text.partition("Notes\n-----")[2]
    if name not in ("process", "truth", "samples.make"):  # of files and movements, which say theirs
        assert UNIT.search(text)


def test_every_exported_name_is_described_on_the_page_of_the_reference() -> None:
    things = [getattr(handscope, name) for name in handscope.__all__]
    assert [t for t in things if not (inspect.getdoc(t) or "").strip()] == []
