"""What the program may say, read from its source: the texts of refusals, findings and warnings with something in each of their gaps."""

import ast
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[3]
REFUSALS = {
    "InputError",
    "NotNowError",
    "UnconfirmedError",
    "ThrottledError",
    "HTTPException",
    "Finding",
    "Verdict",
}
GRADES = {"good", "fair", "poor"}
WARNS = {
    "warnings",
    "said",
    "messages",
    "sentences",
    "problems",
    "reasons",
    "refused",
    "notices",
    "unobserved",
}  # lists that sentences are appended to
MAKE = {
    "_warnings",
    "_flag_warnings",
    "rate_warnings",
    "_mistakes",
    "_first_fault",
    "wrong_hand_sentence",
    "other_glove_sentence",
    "_sentence",
    "_losses_to_mend",
    "_rates_to_mend",
    "_clock_to_mend",
    "sensors_to_mend",
    "_absent",
    "_ask_for_taps",
    "shortfalls",
    "_likely_unit",
    "_magnetometer",
    "_explain_failure",
    "_ask_unit",
}  # functions that give sentences
GAP = re.compile(r"\{[^{}]*\}")
CODE = re.compile(r"[a-z0-9_]+\.[a-z0-9_]+")  # of a message: test_messages.py
OWN_WORDS = re.compile(r"[a-z]{2}\W+[a-z]{2}")
MOST = 32  # texts of one expression
Texts = Mapping[str, Sequence[str]]


@dataclass(frozen=True)
class Sentence:
    """One text, and where it is written."""

    where: str  # path:line
    text: str  # as written, with {expressions} in its gaps

    def example(self) -> str:
        """The text with a word in each gap, another for each expression."""
        words: dict[str, str] = {}
        return GAP.sub(lambda gap: words.setdefault(gap[0], f"Q{len(words) + 1}"), self.text)


def sentences(folders: Sequence[str], but: Sequence[str]) -> list[Sentence]:
    """Of every module in these folders but those whose path begins so."""
    paths = sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))
    names = [(path.relative_to(ROOT).as_posix(), path) for path in paths]
    return [
        s
        for name, path in names
        if not name.startswith(tuple(but))
        for s in _of_module(name, ast.parse(path.read_text("utf-8")))
    ]


def _of_module(name: str, module: ast.Module) -> Iterator[Sentence]:
    constants = _assigned(module.body, {})
    functions = [
        n for n in ast.walk(module) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    for function in functions:
        known = _assigned([n for n in ast.walk(function) if isinstance(n, ast.stmt)], constants)
        for node in ast.walk(function):
            for said in _said(node, function.name):
                yield from (
                    Sentence(f"{name}:{said.lineno}", text)
                    for text in _texts(said, known)
                    if OWN_WORDS.search(GAP.sub("", text)) and not CODE.fullmatch(text)
                )


def _said(node: ast.AST, function: str) -> Iterator[ast.expr]:
    """Expressions that a person is told."""
    match node:
        case ast.Call(func=ast.Name(id=called), args=args) if called in REFUSALS:
            yield from args
            yield from (k.value for k in node.keywords if k.arg == "detail")
        case ast.Call(
            func=ast.Attribute(attr="__init__", value=ast.Call(func=ast.Name(id="super"))),
            args=args,
        ):
            yield from args
        case ast.Call(func=ast.Attribute(attr="append", value=ast.Name(id=into)), args=args) if (
            into in WARNS
        ):
            yield from args
        case ast.Yield(value=ast.expr() as value) | ast.Return(value=ast.expr() as value) if (
            function in MAKE
        ):
            yield value
        case ast.Call(args=[_, *_] as each) | ast.Tuple(elts=each):  # a grade and its reason
            yield from (
                reason
                for grade, reason in itertools.pairwise(each)
                if isinstance(grade, ast.Constant) and grade.value in GRADES
            )


def _assigned(statements: Sequence[ast.stmt], known: Texts) -> dict[str, Sequence[str]]:
    """What names stand for, where all that is assigned to them are texts."""
    found: dict[str, list[ast.expr]] = {}
    for statement in statements:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                found.setdefault(name, []).append(value)
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
                for one, value in zip(names, values):
                    if isinstance(one, ast.Name):
                        found.setdefault(one.id, []).append(value)
    named = dict(known)
    for name, values in 2 * list(
        found.items()
    ):  # one may stand for another that is assigned further down
        texts = [_texts(value, named) for value in values]
        if all(texts):
            named[name] = [text for some in texts for text in some]
    return named


def _texts(node: ast.expr, known: Texts) -> Sequence[str]:
    """Everything that an expression may say; nothing where it is no text in the source."""
    match node:
        case ast.Constant(value=str(text)):
            return [text.replace("{", "(").replace("}", ")")]
        case ast.Name(id=name):
            return known.get(name, [])
        case ast.IfExp(body=body, orelse=otherwise):
            return (
                [*_in_gap(body, known), *_in_gap(otherwise, known)]
                if _texts(body, known) or _texts(otherwise, known)
                else []
            )
        case ast.BinOp(left=left, op=ast.Add(), right=right) if _texts(left, known) or _texts(
            right, known
        ):
            return _joined([_in_gap(left, known), _in_gap(right, known)])
        case ast.JoinedStr(values=values):
            return _joined(
                [
                    _in_gap(v.value if isinstance(v, ast.FormattedValue) else v, known)
                    for v in values
                ]
            )
    return []


def _in_gap(node: ast.expr, known: Texts) -> Sequence[str]:
    return _texts(node, known) or [f"{{{re.sub('[{}]', '', ast.unparse(node))}}}"]


def _joined(parts: Sequence[Sequence[str]]) -> list[str]:
    return ["".join(each) for each in itertools.islice(itertools.product(*parts), MOST)]
