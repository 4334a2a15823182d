"""What the program reads in the files of the first edition, as plain data.

`make.py` wrote it to files/expected.json with the first edition. A later version that names a route's field or a module otherwise
changes the lookup here; what comes out stays the same.
"""

import contextlib
import csv
import hashlib
import json
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from starlette.testclient import TestClient

from handscope.app.auth.gate import new_token
from handscope.app.cli import main
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.sessions.formats import recordings as formats

RECORDINGS = (
    *("simulated.zip", "wiggle.zip", "free.zip", "lift.zip", "reach.zip", "laid_down.zip"),
    *("functional.mcap", "glove.mcap"),
)
ASSESSED = ("wiggle.zip", "lift.zip", "reach.zip")
PROCESSED = {  # by name, the words of `process`
    "functional steps": ("functional.mcap", "--method", "m2"),
    "self-calibration taken over": (
        "free.zip",
        "--method",
        "m2",
        "--calibration",
        "self_calibration.json",
    ),
}
CURVE = "index_pip_flexion"
BASE = "http://127.0.0.1:8420"


def expected(files: Path) -> dict[str, Any]:
    """All that is written down."""
    with tempfile.TemporaryDirectory() as name:
        folder = unpack(files / "data.zip", Path(name))
        with served(folder) as client:
            data = read_data_folder(client)
    return {
        "recordings": {name: read_recording(files / name) for name in RECORDINGS},
        "figures": {name: assess(files / name) for name in ASSESSED},
        "angles": {name: summarize_angles(files, words) for name, words in PROCESSED.items()},
        "data": data,
    }


def run(*words: object) -> None:
    """One command of the program."""
    assert main([str(word) for word in words]) == 0, words


def read_recording(path: Path) -> dict[str, Any]:
    """Streams with a hash of their samples, and events."""
    recording = formats.load(path)
    streams = {}
    for name, block in recording.samples.items():
        samples = np.concatenate([block.t, block.values.ravel()]).astype(
            "<f4"
        )  # the last bits of a double are the machine's
        streams[name] = {
            "sensors": list(block.stream.sensors),
            "quantities": list(block.stream.quantities),
            "rate": block.stream.rate,
            "samples": len(block.t),
            "sha256": hashlib.sha256(samples.tobytes()).hexdigest(),
        }
    events = [[e.trial_type, e.onset, e.duration, dict(e.details)] for e in recording.events]
    lengths = {segment: round(length, 9) for segment, length in recording.geometry.lengths.items()}
    return {"hand": recording.hand, "streams": streams, "events": events, "lengths": lengths}


def read_table(place: Path) -> tuple[list[str], Any]:
    """Columns and values of a derivative in a folder or a zip."""
    with tempfile.TemporaryDirectory() as name:
        folder = place if place.is_dir() else unpack(place, Path(name))
        path = next(folder.rglob("*_motion.tsv"))
        rows = (
            path.with_name(path.name.replace("_motion", "_channels")).read_text().splitlines()[1:]
        )
        return [row.split("\t")[0] for row in rows], np.genfromtxt(
            path, delimiter="\t", missing_values="n/a"
        )


def summarize_angles(files: Path, words: tuple[str, ...]) -> dict[str, list[float]]:
    """Mean and standard deviation, rad, of every joint angle that `process` gives."""
    with tempfile.TemporaryDirectory() as name:
        run("process", *(files / w if (files / w).is_file() else w for w in words), "--out", name)
        columns, table = read_table(Path(name))
    angles = [
        k for k, c in enumerate(columns) if c.endswith(("_flexion", "_deviation", "_pronation"))
    ]
    seen = [k for k in angles if np.isfinite(table[:, k]).any()]
    return {
        columns[k]: [float(np.nanmean(table[:, k])), float(np.nanstd(table[:, k]))] for k in seen
    }


def assess(path: Path) -> dict[str, float | None]:
    """Every figure of `assess` by method m2, by task and name, in the unit of the table."""
    with tempfile.TemporaryDirectory() as name:
        run("assess", path, "--method", "m2", "--out", name)
        return read_figures(Path(name, "figures.csv"))


def read_figures(path: Path) -> dict[str, float | None]:
    rows = csv.DictReader(
        line for line in path.read_text().splitlines() if not line.startswith("#")
    )
    return {f"{r['task']} {r['name']}": float(r["value"]) if r["value"] else None for r in rows}


def unpack(source: Path, folder: Path) -> Path:
    with zipfile.ZipFile(source) as archive:
        archive.extractall(folder)
    return folder


@contextlib.contextmanager
def served(folder: Path) -> Iterator[TestClient]:
    """A client that is logged in to a server of the data folder."""
    with TestClient(
        create_app(Settings(data=folder)), base_url=BASE, follow_redirects=False
    ) as client:
        assert client.post("/api/login", json={"token": new_token(folder)}).status_code == 204
        yield client


def read_data_folder(client: TestClient) -> dict[str, Any]:
    """Patients, sessions, recordings, corrections, results, self-calibrations and accounts, over the API."""

    def ask(path: str, **params: Any) -> Any:
        answer = client.get(f"/api/{path}", params=params)
        assert answer.status_code == 200, (path, answer.text)
        return answer.json()

    patients = [
        ask(f"patients/{row['id']}") for row in sorted(ask("patients"), key=lambda row: row["id"])
    ]
    sessions = [
        ask(f"sessions/{s['id']}")
        for p in patients
        for s in sorted(p["sessions"], key=lambda s: s["id"])
    ]
    return {
        "patients": [
            _fields(
                p,
                "pseudonym year_of_birth dominant_hand affected_hand hand_measures trunk_height archived created",
            )
            | {
                "notes": [n["text"] for n in p["notes"]],
                "sessions": sorted(s["id"] for s in p["sessions"]),
            }
            for p in patients
        ],
        "sessions": [
            _fields(
                s,
                "id patient hand state started finished examiner notes trunk_height tasks geometry",
            )
            | {
                "recordings": [_recording(ask, f) for f in s["recordings"]],
                "reuse": _reuse(ask(f"sessions/{s['id']}/reuse")),
            }
            for s in sessions
        ],
        "self_calibrations": [
            _self_calibration(c)
            for p in patients
            for c in ask(f"patients/{p['id']}/self-calibrations")
        ],
        "progress": [_progress(ask(f"patients/{p['id']}/progress")) for p in patients],
        "accounts": sorted([a["name"], a["roles"], a["disabled"]] for a in ask("accounts")),
    }


def _fields(row: dict[str, Any], names: str) -> dict[str, Any]:
    return {name: row[name] for name in names.split()}


def _recording(ask: Any, row: dict[str, Any]) -> dict[str, Any]:
    events = [
        [e["trial_type"], e["onset"], e["duration"], e["task"]] for e in row["summary"]["events"]
    ]
    return {
        **_fields(row, "id format sha256 bytes"),
        "duration": row["summary"]["duration"],
        "events": events,
        "corrections": [
            _fields(c, "event kind onset end reason undone") for c in row["corrections"]
        ],
        "results": [_result(ask, r) for r in row["results"]],
    }


def _result(ask: Any, row: dict[str, Any]) -> dict[str, Any]:
    result = ask(f"results/{row['id']}")
    curve = ask(f"results/{row['id']}/curves", what=CURVE, points=20)
    return {
        **_fields(row, "id method parameters version state created current reused"),
        "figures": {
            f"{f['task']} {f['name']}": [f["value"], f["unit"], f["sd"]] for f in result["figures"]
        },
        "warnings": len(result["warnings"]),
        "curve": [curve["t"], curve["curves"][CURVE]],
        "report": len(ask(f"results/{row['id']}/report.json")["figures"]),
    }


def _reuse(row: dict[str, Any]) -> dict[str, Any] | None:
    return row["decided"] and _fields(row["decided"], "parts self_calibration made")


def _self_calibration(row: dict[str, Any]) -> dict[str, Any]:
    found = {part: [values[1:3] for values in row["tables"][part]] for part in ("seats", "biases")}
    return {**_fields(row, "id hand session recording onset kept withdrawn version"), **found}


def _progress(row: dict[str, Any]) -> dict[str, Any]:
    return {
        f"{s['task']} {s['name']}": {hand: h["points"] for hand, h in s["hands"].items()}
        for s in row["series"]
    }


def load_expected(files: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((files / "expected.json").read_text())
    return found
