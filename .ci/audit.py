"""Known weaknesses of the dependencies' locked versions.

    python .ci/audit.py [--advisories FILE.zip] [LOCK ...]

With `--advisories` (or HANDSCOPE_ADVISORIES) offline, from an archive of advisories in the OSV format, as the Open Source Vulnerabilities project publishes
one for each ecosystem (`PyPI/all.zip`): every locked version is checked. Without it a public service is asked through pip-audit, which
knows only some.

Exit code 0: every version was checked and has no known weakness; 1: there are some; 3: no weakness was found, and not every version was checked.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from packaging.utils import canonicalize_name
from packaging.version import InvalidVersion, Version

ROOT = Path(__file__).parent.parent
LOCKS = ("requirements.lock", "requirements-server.lock")
FOUND, UNCHECKED = 1, 3
WAIT = 90  # s for the service


@dataclass
class Audit:
    """What was found out, by name of the dependency."""

    source: str
    weaknesses: dict[str, list[str]] = field(default_factory=dict)  # names of advisories
    checked: set[str] = field(default_factory=set)


def locked_versions(locks: list[Path]) -> dict[str, str]:
    """Versions by name, of lines like `numpy==2.4.1 ; marker`."""
    lines = [line for lock in locks for line in lock.read_text().splitlines()]
    found = [re.match(r"([A-Za-z0-9._-]+)==([^\s;\\]+)", line) for line in lines]
    return {canonicalize_name(m[1]): m[2] for m in found if m}


def audit_offline(locked: dict[str, str], archive: Path) -> Audit:
    """Compare every locked version with every advisory of an OSV archive."""
    newest, made = "", Audit("")
    for advisory in _advisories(archive):
        newest = max(newest, str(advisory.get("modified", "")))
        if advisory.get("withdrawn"):
            continue
        for affected in advisory.get("affected", ()):
            package = affected.get("package", {})
            name = canonicalize_name(str(package.get("name", "")))
            if (
                package.get("ecosystem") == "PyPI"
                and name in locked
                and affects(affected, locked[name])
            ):
                made.weaknesses.setdefault(name, []).append(str(advisory["id"]))
    made.source = f"{archive.name}, its newest advisory of {newest[:10] or 'no known day'}"
    made.checked = set(locked) if newest else set()
    return made


def affects(affected: dict[str, Any], version: str) -> bool:
    """Whether a version is among those that an advisory names, one by one or by ranges (OSV schema, `affected`)."""
    if version in affected.get("versions", ()):
        return True
    ranges = [r for r in affected.get("ranges", ()) if r.get("type") == "ECOSYSTEM"]
    return any(_within(r.get("events", ()), Version(version)) for r in ranges)


def audit_online(locked: dict[str, str], locks: list[Path], tools: Path) -> Audit:
    """Ask the public service through pip-audit; where it cannot be reached nothing was checked."""
    made = Audit("a public service")
    for lock in locks:
        words = [
            "tool",
            "run",
            "--quiet",
            "pip-audit",
            "--progress-spinner",
            "off",
            "--disable-pip",
        ]
        words += ["--require-hashes", "--format", "json", "-r", str(lock)]
        try:
            done = subprocess.run(
                [tools / "uv", *words], capture_output=True, text=True, timeout=WAIT, check=False
            )
            answers = json.loads(done.stdout)["dependencies"]
        except (OSError, ValueError, KeyError, subprocess.TimeoutExpired):
            continue
        for answer in answers:
            name = canonicalize_name(answer["name"])
            if "skip_reason" not in answer and answer.get("version") == locked.get(name):
                made.checked.add(name)
            if known := [weakness["id"] for weakness in answer.get("vulns", ())]:
                made.weaknesses[name] = known
    return made


def report(locked: dict[str, str], made: Audit) -> int:
    """One line for each dependency that has a weakness or was not checked; the exit code."""
    say = sys.stdout.write
    for name, known in sorted(made.weaknesses.items()):
        say(f"{name} {locked.get(name, '')}: {', '.join(sorted(known))}\n")
    unchecked = sorted(set(locked) - made.checked - set(made.weaknesses))
    for name in unchecked:
        say(f"{name} {locked[name]}: not checked\n")
    say(
        f"dependencies: {len(locked)} locked, {len(locked) - len(unchecked)} checked by {made.source}, "
        f"{len(unchecked)} not checked, {len(made.weaknesses)} with known weaknesses\n"
    )
    return FOUND if made.weaknesses else UNCHECKED if unchecked else 0


def _advisories(archive: Path) -> Iterator[dict[str, Any]]:
    with zipfile.ZipFile(archive) as zipped:
        for name in zipped.namelist():
            if name.endswith(".json"):
                yield json.loads(zipped.read(name))


def _within(events: Any, version: Version) -> bool:
    """Whether the last event at or before the version leaves it affected."""
    inside = False
    for event in sorted(events, key=_moment):
        ((kind, word),) = list(event.items())[:1]
        if kind == "introduced" and (word == "0" or _version(word) <= version):
            inside = True
        elif (kind == "fixed" and _version(word) <= version) or (
            kind == "last_affected" and _version(word) < version
        ):
            inside = False
    return inside


def _moment(event: dict[str, str]) -> Version:
    return _version(next(iter(event.values())))


def _version(word: str) -> Version:
    try:
        return Version(word)
    except InvalidVersion:
        return Version("0")


def main(words: list[str]) -> int:
    """Audit the locks that are named, or the server's; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("locks", nargs="*", type=Path, default=[ROOT / lock for lock in LOCKS])
    parser.add_argument("--advisories", type=Path, default=os.environ.get("HANDSCOPE_ADVISORIES"))
    given = parser.parse_args(words)
    locked = locked_versions(given.locks)
    if not given.advisories:
        return report(locked, audit_online(locked, given.locks, Path(sys.executable).parent))
    try:
        made = audit_offline(locked, Path(given.advisories))
    except (OSError, ValueError, zipfile.BadZipFile) as problem:
        sys.stderr.write(f"{given.advisories} holds no advisories in the OSV format: {problem}\n")
        return 2
    return report(locked, made)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
