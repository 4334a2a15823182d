"""Tasks as data: one JSON file each in this folder, or in the data folder's `protocols`, named as its task; a new task needs no code
(docs/extending.md has an example).

The fields are those of `Protocol` below. A file with a mistake is named with its field and left out; the others are offered. A task ends in one of three ways: after `duration` s; paced, after `repetitions` rounds of `cycle`
(the metronome, its words and the countdown of each phase come from there); or, with neither, when somebody presses "Done".
"""

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, fields, replace
from importlib.resources import files
from importlib.resources.abc import Traversable
from itertools import accumulate
from pathlib import Path
from typing import Annotated, Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from handscope.app.protocols.lines import line_of
from handscope.estimators.data.held_contact import ELSEWHERE, POINTS
from handscope.estimators.data.samples import TRACKED_POINTS
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, DOF_NAMES, FINGERS
from handscope.estimators.messages.sentence import phrase, with_code
from handscope.estimators.messages.system import describe

Word = Annotated[str, Field(pattern="^[a-z][a-z0-9_]*$", max_length=60)]
Line = Annotated[str, Field(min_length=1, max_length=300)]
Seconds = Annotated[float, Field(gt=0, le=600)]
Count = Annotated[int, Field(ge=1, le=100)]
CURVES = ("aperture", "palm_turn", *DOF_NAMES)
TURN = "forearm_pronation"  # no joint of the glove's: it turns the ghost's whole hand
SLACK = 0.15  # s by which the end of an attempt may be late or early: the station looks ten times a second
EXACT = 1e-6  # s
OWN = "protocols"  # in the data folder
_POINT = f"({'|'.join(FINGERS)})_({'|'.join(POINTS)})"
_TOUCH = f"{_POINT}-({_POINT}|{'|'.join('_'.join(place) for place in ELSEWHERE)})"
_CONTACTS = f"^{_TOUCH}( {_TOUCH})*$"
STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


@dataclass(frozen=True, kw_only=True)
class Phase:
    """A part of a paced movement: the word that is shown when it begins, and how long it lasts."""

    __pydantic_config__ = STRICT

    say: Annotated[str, Field(min_length=1, max_length=20)]
    seconds: Seconds
    # such stretches of an accepted attempt are marked in the recording under this name
    mark: Word | None = None
    # what fingertips are held against meanwhile, for calibration; of marked phases
    contacts: Annotated[str, Field(pattern=_CONTACTS)] | None = None


@dataclass(frozen=True, kw_only=True)
class Score:
    """A score that the clinician gives by eye; it is kept beside the measures and never computed."""

    __pydantic_config__ = STRICT

    title: Annotated[str, Field(min_length=1, max_length=60)]
    least: int = 0
    most: int
    hint: Annotated[str, Field(max_length=200)] = ""


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """One task: its words, how often and how long it is done, and how it is cued."""

    __pydantic_config__ = STRICT

    name: Word  # of the file too, and the task_name in the recording's events
    title: Line  # what the clinician reads in the list
    instruction: Line  # two sentences for the patient
    group: Word  # tasks that are offered together
    order: int  # where it stands in the list
    routine: bool = False  # part of the usual assessment, which is offered first
    source: str = ""  # where pace and numbers come from
    duration: Seconds | None = None  # s
    # one movement; the metronome beats where a phase begins
    cycle: Annotated[tuple[Phase, ...], Field(max_length=12)] = ()
    repetitions: Count | None = None  # movements in a trial
    trials: Count = 1  # times that the task is to be accepted
    pause: Annotated[float, Field(ge=0, le=600)] = 0.0  # s of rest between two trials
    # where a paused trial goes on: where it stopped, or with the phase or repetition that the pause
    # broke off; None: a pause ends the trial, because its rhythm, decrement or whole length is what
    # is measured
    resumes: Literal["anywhere", "phase", "repetition"] | None = None
    # s before it starts, and before it goes on after a pause
    countdown: Annotated[float, Field(ge=0, le=30)] = 3.0
    curve: str  # "aperture" (thumb to index tip), "palm_turn", or a joint angle such as index_pip_flexion; movements are counted on it
    # segments and force sensors that must be measured for the task to be offered
    needs: tuple[str, ...] = ()
    needs_any: tuple[str, ...] = ()  # of these, `needs_count` must be measured, too; empty: none
    needs_count: Count = 1
    # postures (joint angles and forearm_pronation, deg) that the ghost goes through; empty: none
    ghost: tuple[Mapping[str, float], ...] = ()
    pace: Seconds = 1.5  # s that each of them takes
    # who moves the hand: the patient, or the therapist while the patient lets go
    mode: Literal["active", "passive"] = "active"
    score: Score | None = None  # asked of the clinician with every trial
    # kept in the recording with every trial, for the measures
    details: Mapping[str, str] = field(default_factory=dict)
    cue: Annotated[str, Field(max_length=60)] = ""  # what a virtual patient is cued to do
    cue_details: Mapping[str, str] = field(default_factory=dict)

    @property
    def period(self) -> float:
        """Length of the cycle, s; 0 for a task that is not paced."""
        return sum(p.seconds for p in self.cycle)

    @property
    def length(self) -> float | None:
        """Seconds that the task takes, or None: until "Done"."""
        return self.period * (self.repetitions or 0) if self.cycle else self.duration

    def is_possible(self, measured: Set[str]) -> bool:
        """Whether the task can be done with what is measured: segments and places of force sensors."""
        some = measured & set(self.needs_any)
        return set(self.needs) <= measured and (not self.needs_any or len(some) >= self.needs_count)

    def curve_of(self, measured: Set[str]) -> str:
        """The live curve; of the first finger that is measured where the task's own one is not."""
        finger, _, rest = self.curve.partition("_")
        if finger not in FINGERS or any(s in measured for s in CHAINS[finger]):
            return self.curve
        others = [f for f in FINGERS if f != "thumb" and CHAINS[f][0] in measured]
        return f"{others[0]}_{rest}" if others and f"{others[0]}_{rest}" in CURVES else self.curve

    def resumed_at(self, done: float) -> float:
        """Where a trial goes on that was paused `done` s into it, in s of the trial."""
        if not self.cycle or self.resumes == "anywhere":
            return done
        n = self._begun(done)
        return self._starts()[n if self.resumes == "phase" else n - n % len(self.cycle)]

    def at(self, done: float) -> tuple[Phase, int] | None:
        """The phase that begins or goes on `done` s into a trial, and its repetition from 1 on; None without a cycle."""
        n = self._begun(done)
        return (self.cycle[n % len(self.cycle)], n // len(self.cycle) + 1) if self.cycle else None

    def marks(
        self, onset: float, end: float, pauses: Sequence[tuple[float, float]] = ()
    ) -> list[tuple[float, Phase, int]]:
        """Marked phases that lie whole within an attempt from onset to end (s): when each begins, the phase, its repetition from 1 on.

        `pauses` are the stretches (from, to) s that the attempt went on after.
        """
        every = []
        for n, start in enumerate(self._starts()):
            phase = self.cycle[n % len(self.cycle)]
            t = onset + start
            for from_, to in pauses:
                t += to - from_ if from_ <= t + EXACT else 0.0
            if phase.mark and t + phase.seconds <= end + SLACK:
                every.append((t, phase, n // len(self.cycle) + 1))
        return every

    def _begun(self, done: float) -> int:
        """Number of the newest phase, over all repetitions from 0 on, that began `done` s into the trial."""
        return max(0, sum(s <= done + EXACT for s in self._starts()) - 1)

    def _starts(self) -> list[float]:
        """When each phase of each repetition begins, s of the trial."""
        seconds = [p.seconds for p in self.cycle] * (self.repetitions or 0)
        return list(accumulate(seconds, initial=0.0))[: len(seconds)]


UNKNOWN = ("unexpected_keyword_argument", "extra_forbidden")  # pydantic's words
_READER = TypeAdapter(Protocol)


def load_all(folder: Traversable | None = None) -> dict[str, Protocol]:
    """Every protocol of a folder (this one) that has no fault by name, in order."""
    return read(folder)[0]


def offered(data: Path) -> tuple[dict[str, Protocol], list[str]]:
    """All that a server offers, in order: the protocols of this folder and those of its data folder, read anew each time; and their faults."""
    (own, own_faults), (known, faults) = (
        (read(data / OWN) if (data / OWN).is_dir() else ({}, [])),
        read(),
    )
    taken = [
        phrase("protocol.name_taken", file=f"{name}.json", name=name)
        for name in own
        if name in known
    ]
    both = {**own, **known}
    return {p.name: p for p in sorted(both.values(), key=lambda p: p.order)}, [
        *faults,
        *own_faults,
        *taken,
    ]


def read(folder: Traversable | None = None) -> tuple[dict[str, Protocol], list[str]]:
    """Every protocol of a folder (this one) by name, in order, and a sentence for each file that has a fault: its field and what is allowed."""
    inside = sorted(
        (folder or files("handscope.app.protocols")).iterdir(), key=lambda entry: entry.name
    )
    found, faults = [], []
    for entry in (e for e in inside if e.name.endswith(".json")):
        try:
            found.append(_load_entry(entry))
        except InputError as fault:
            faults.append(str(fault))
    return {p.name: p for p in sorted(found, key=lambda p: p.order)}, faults


def load_steps() -> dict[str, Protocol]:
    """The steps of a functional calibration, in order: the folder `functional`; each is named as the step that it is."""
    return load_all(files("handscope.app.protocols") / "functional")


def load_free() -> Protocol:
    """The free movement that a hand calibrates itself from: the folder `self_calibration`."""
    (found,) = load_all(files("handscope.app.protocols") / "self_calibration").values()
    return found


def groups(protocols: Iterable[Protocol]) -> list[str]:
    """The groups of tasks, in the order of the tasks."""
    return list(dict.fromkeys(p.group for p in protocols))


def protocol_of(file: str, text: str) -> Protocol:
    """A protocol from its file's text, checked."""
    try:
        made = _READER.validate_json(text)
    except ValidationError as problem:
        raise _fault(file, text, _sentence(problem.errors())) from None
    for wrong in _mistakes(file, made):
        raise _fault(file, text, wrong)
    return _with_codes(made)


def _with_codes(p: Protocol) -> Protocol:
    """The words of our own tasks with their message codes; a task of the data folder has words of its own."""
    phases = tuple(
        replace(phase, say=with_code(f"task_phase.{p.name}_{k + 1}", phase.say))
        for k, phase in enumerate(p.cycle)
    )
    score = p.score and replace(
        p.score,
        title=with_code(f"task_score.{p.name}", p.score.title),
        hint=with_code(f"task_score_hint.{p.name}", p.score.hint),
    )
    title = with_code(f"task_title.{p.name}", p.title)
    instruction = with_code(f"task_instruction.{p.name}", p.instruction)
    shared = with_code(f"task_source.{p.group}", p.source)
    source = with_code(f"task_source.{p.name}", shared)
    return replace(
        p, title=title, instruction=instruction, source=source, cycle=phases, score=score
    )


def _fault(file: str, text: str, sentence: str) -> InputError:
    line = line_of(text, sentence)
    return InputError(
        phrase("protocol.at_line", file=file, line=line, what=sentence)
        if line
        else phrase("protocol.in_file", file=file, what=sentence)
    )


def _load_entry(entry: Traversable) -> Protocol:
    try:
        text = entry.read_text("utf-8")
    except OSError as problem:
        raise InputError(
            "protocol.unreadable", file=entry.name, problem=describe(problem)
        ) from None
    except UnicodeDecodeError:
        raise InputError("protocol.not_utf8", file=entry.name) from None
    return protocol_of(entry.name, text)


def _mistakes(file: str, p: Protocol) -> Iterable[str]:
    """What a field's own kind does not tell, in the order of the fields."""
    if f"{p.name}.json" != file:
        yield phrase("protocol.name_not_the_files", name=p.name)
    if p.cycle and p.duration is not None:
        yield phrase("protocol.duration_and_cycle")
    if p.cycle and p.repetitions is None:
        yield phrase("protocol.repetitions_missing")
    if p.resumes in ("phase", "repetition") and not p.cycle:
        yield phrase("protocol.resumes_without_cycle", value=p.resumes)
    if p.pause and p.trials == 1:
        yield phrase("protocol.pause_of_one_trial")
    if p.curve not in CURVES:
        yield phrase("protocol.unknown_curve", value=p.curve)
    for key, name in (*(("needs", n) for n in p.needs), *(("needs_any", n) for n in p.needs_any)):
        if name not in TRACKED_POINTS:
            yield phrase(
                "protocol.unknown_place", key=key, name=name, points=", ".join(TRACKED_POINTS)
            )
    if p.needs_count > max(1, len(p.needs_any)):
        yield phrase("protocol.needs_count", count=p.needs_count, number=len(p.needs_any))
    for k, name in ((k, name) for k, posture in enumerate(p.ghost) for name in posture):
        if name not in (*DOF_NAMES, TURN):
            yield phrase("protocol.unknown_ghost_angle", number=k, name=name)
    if p.score and p.score.least >= p.score.most:
        yield phrase("protocol.score_range", most=p.score.most, least=p.score.least)


def _sentence(errors: Sequence[ErrorDetails]) -> str:
    """The first thing wrong, in words."""
    # a misspelt field is missing, too
    error, more = min(errors, key=lambda e: e["type"] not in UNKNOWN), len(errors) - 1
    where = "".join(
        f"[{part}]" if isinstance(part, int) else f".{part}" for part in error["loc"]
    ).lstrip(".")
    kind_of = (
        Phase if where.startswith("cycle[") else Score if where.startswith("score.") else Protocol
    )
    allowed = [f.name for f in fields(kind_of)]
    words = error["msg"].replace("Input should", "it should")
    match error["type"]:
        case "json_invalid":
            return phrase("protocol.not_json", what=error["msg"].removeprefix("Invalid JSON: "))
        case "missing" | "missing_argument":
            return _and_more(phrase("protocol.field_missing", field=where), more)
        case kind if kind in UNKNOWN:
            names = ", ".join(allowed)
            return _and_more(phrase("protocol.unknown_field", field=where, fields=names), more)
    if not where:
        return phrase("protocol.not_an_object", fields=", ".join(allowed))
    return _and_more(_wrong_value(where, error, f"{words[0].lower()}{words[1:]}"), more)


def _wrong_value(where: str, error: ErrorDetails, words: str) -> str:
    value, limits = repr(error["input"]), error.get("ctx") or {}
    match error["type"]:
        case "greater_than":
            return phrase("protocol.greater", field=where, value=value, least=f"{limits['gt']:g}")
        case "greater_than_equal":
            return phrase("protocol.at_least", field=where, value=value, least=f"{limits['ge']:g}")
        case "string_pattern_mismatch":
            words = phrase("protocol.name_form")
    return phrase("protocol.value", field=where, value=value, what=words)


def _and_more(sentence: str, more: int) -> str:
    return phrase("protocol.more_mistakes", what=sentence, count=more) if more else sentence
