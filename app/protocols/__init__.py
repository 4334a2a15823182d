"""Tasks as data: one JSON file each in this folder; a new task needs no code.

name          unique, also the task_name in the recording's events
title, instruction  what the clinician and the patient read
duration      s, or null: until "Done"
countdown     s before it starts
curve         "aperture" (thumb to index tip), or a joint angle such as index_pip_flexion
needs         segments that must be measured for the task to be offered
ghost         postures (joint angles in deg) that the ghost hand goes through, each held `pace` s; empty: no ghost
cue           what a virtual patient is told to do
order         where it stands in the list
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from importlib.resources import files
from typing import Any

from estimators.errors import InputError
from estimators.hand_anatomy import DOF_NAMES, SEGMENTS


@dataclass(frozen=True, kw_only=True)
class Protocol:
    name: str
    title: str
    instruction: str
    duration: float | None
    countdown: float
    curve: str
    order: int
    needs: tuple[str, ...] = ()
    ghost: tuple[Mapping[str, float], ...] = ()
    pace: float = 1.5
    cue: str = ""
    cue_details: Mapping[str, str] = field(default_factory=dict)


def load_all() -> dict[str, Protocol]:
    """Every protocol of this folder by name, in order; InputError names the file that has a fault."""
    found = [
        protocol_of(entry.name, entry.read_text("utf-8")) for entry in files("app.protocols").iterdir() if entry.name.endswith(".json")
    ]
    return {p.name: p for p in sorted(found, key=lambda p: p.order)}


def protocol_of(file: str, text: str) -> Protocol:
    """A protocol from its file's text, checked."""
    try:
        value: dict[str, Any] = json.loads(text)
    except ValueError as problem:
        raise InputError(f"protocol {file} is not valid JSON: {problem}") from None
    known = {f.name for f in fields(Protocol)}
    if not isinstance(value, dict) or set(value) - known:
        raise InputError(f"protocol {file} has unknown entries {sorted(set(value) - known)}; known are {sorted(known)}")
    try:
        made = Protocol(**{**value, "needs": tuple(value.get("needs", ())), "ghost": tuple(value.get("ghost", ()))})
    except TypeError as problem:
        raise InputError(f"protocol {file} is incomplete: {problem}") from None
    if made.curve not in ("aperture", *DOF_NAMES):
        raise InputError(f"protocol {file}: curve {made.curve!r} is neither aperture nor a joint angle such as index_pip_flexion")
    wrong = [name for name in made.needs if name not in SEGMENTS] + [name for pose in made.ghost for name in pose if name not in DOF_NAMES]
    if wrong:
        raise InputError(f"protocol {file} names {wrong[0]!r}, which is no segment or joint angle")
    return made
