"""Everything about one patient in one zip, written as it goes: nothing is held in memory but one recording at a time.

patient.json        facts, notes and what self-calibration found of the hands
sessions/NUMBER/    session.json, every recording as it was kept, a native one also as Motion-BIDS, every result as JSON with its replay (npz)
manifest.json       all files with size and SHA-256, when and with which software, and what could not be put in
SHA256SUMS          the same sums as `sha256sum -c` reads them
"""

import hashlib
import json
import time
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from datetime import date
from pathlib import Path
from typing import IO, Any

from sqlalchemy import inspect
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.messages.system import describe
from handscope.sessions.clinic import patients
from handscope.sessions.db.tables import Base, PatientSession, RecordingFile, now
from handscope.sessions.hand_photographs import photographs
from handscope.sessions.motion_bids import writer
from handscope.sessions.sealing.stored import open_stored
from handscope.sessions.store import records, stored_files
from handscope.sessions.store.store import Store
from handscope.sessions.tables_io.number_table import pieces

PIECE = 2**20
README = """Everything that Handscope kept about one patient.

patient.json     facts, notes, self-calibrations, what photographs told, treatment,
                 goals (in the unit that each names); SI units, times in UTC
photographs/     pictures of the hands that were kept
sessions/        a folder a session: session.json, the recordings as they were kept (and as Motion-BIDS), the results
manifest.json    every file with its size and SHA-256; check with: sha256sum -c SHA256SUMS

Figures are in SI units (rad, m, s). The movement of a result (joint angles over time) is in its .npz, thinned for replay; in full it can be computed
again from the recording with the method, options and version that the result names.
"""


class _Archive:
    """A zip that is only appended to, and the sums of what went in."""

    def __init__(self, out: IO[bytes]) -> None:
        self.zip = zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1)
        self.sums: dict[str, tuple[int, str]] = {}

    def put(self, name: str, data: Iterable[bytes]) -> str:
        """Write a file; gives its SHA-256."""
        entry = zipfile.ZipInfo(name, time.gmtime()[:6])
        entry.compress_type = zipfile.ZIP_DEFLATED
        total, size = hashlib.sha256(), 0
        with self.zip.open(entry, "w", force_zip64=True) as file:
            for piece in data:
                file.write(piece)
                total.update(piece)
                size += len(piece)
        self.sums[name] = size, total.hexdigest()
        return total.hexdigest()


def write(db: Session, store: Store, patient_id: int, software: str, out: IO[bytes]) -> None:
    """Write the zip to `out`, which need not be seekable; what is missing or damaged on the disk is named in the manifest."""
    patient = patients.get(db, patient_id)
    archive, problems = _Archive(out), list[str]()
    archive.put("README.txt", [README.encode()])
    notes = [_row(note) for note in patient.notes]
    archive.put(
        "patient.json",
        _json(
            {
                **_row(patient),
                "notes": notes,
                "self_calibrations": [_row(c) for c in patient.self_calibrations],
                "photographs": [
                    {**_row(p), "picture": p.picture is not None} for p in patient.photographs
                ],
                "treatment_events": [_row(e) for e in patient.treatment_events],
                "goals": [_row(g) for g in patient.goals],
            }
        ),
    )
    for photograph in patient.photographs:
        if (picture := photographs.picture_of(photograph)) is not None:
            archive.put(f"photographs/{photograph.id}.jpg", [picture])
    for session_id in [session.id for session in patient.sessions]:
        db.expunge_all()  # what was written is let go
        problems += _session(archive, store, records.get(db, session_id))
    manifest = {
        "exported": now(),
        "software": software,
        "problems": problems,
        "files": [
            {"path": name, "bytes": size, "sha256": total}
            for name, (size, total) in archive.sums.items()
        ],
    }
    archive.put(
        "SHA256SUMS",
        ["".join(f"{total}  {name}\n" for name, (_, total) in archive.sums.items()).encode()],
    )
    archive.put("manifest.json", _json(manifest))
    archive.zip.close()


def _session(archive: _Archive, store: Store, session: PatientSession) -> Iterator[str]:
    """Everything of one session; gives what could not be put in."""
    folder = f"sessions/{session.id}"
    archive.put(
        f"{folder}/session.json",
        _json(
            {
                **_row(session),
                "reuses": [_row(r) for r in session.reuses],
                "recordings": [_recording(f) for f in session.recordings],
            }
        ),
    )
    for file in session.recordings:
        name = f"{folder}/recording-{file.id}{Path(file.file).suffix}"
        try:
            total = archive.put(name, _pieces(stored_files.fetch_local(store, file.file)))
        except InputError as problem:
            yield phrase("patient.file_problem", name=name, problem=str(problem))
            continue
        except OSError as problem:
            yield phrase("patient.recording_unreadable", name=name, problem=describe(problem))
            continue
        if file.sha256 is not None and total != file.sha256:
            yield phrase("patient.recording_changed", name=name, sha256=file.sha256)
        if file.format == "native":
            yield from _motion_bids(archive, store, file, f"{folder}/motion-bids-{file.id}")
        for result in file.results:
            archive.put(f"{folder}/result-{result.id}-{result.method}.json", _json(_row(result)))
            stored = stored_files.files_of_result(store, result.id)
            if result.state == "done" and not stored and store.server not in ("", result.server):
                yield phrase("patient.result_at_other_server", number=result.id)
            for kept in stored:
                archive.put(
                    f"{folder}/result-{Path(kept).name}",
                    _pieces(stored_files.fetch_local(store, kept)),
                )


def _motion_bids(
    archive: _Archive, store: Store, file: RecordingFile, folder: str
) -> Iterator[str]:
    try:
        recording = records.open_recording(store, file)
    except InputError as problem:
        yield f"{folder}: {problem}"
        return
    for name, data in writer.tree(
        recording, f"{file.session.patient_id}", "session", f"{file.session_id}"
    ).items():
        archive.put(f"{folder}/{name}", pieces(data))


def _recording(file: RecordingFile) -> dict[str, Any]:
    return {**_row(file), "corrections": [_row(c) for c in file.corrections]}


def _row(row: Base) -> dict[str, Any]:
    """A row's columns by name."""
    return {c.columns[0].name: getattr(row, c.key) for c in inspect(row).mapper.column_attrs}


def _json(value: Mapping[str, Any]) -> list[bytes]:
    def plain(other: object) -> str:
        return other.isoformat() if isinstance(other, date) else str(other)

    return [json.dumps(value, indent=1, ensure_ascii=False, default=plain).encode()]


def _pieces(path: Path) -> Iterator[bytes]:
    with open_stored(path) as file:
        while piece := file.read(PIECE):
            yield piece
