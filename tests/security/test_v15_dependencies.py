"""ASVS 15.2: the audit of the dependencies says which versions have weaknesses and which it did not check."""

import importlib.util
import json
import zipfile
from pathlib import Path
from typing import Any

import pytest

from tests.test_architecture import ROOT

spec = importlib.util.spec_from_file_location("audit", ROOT / ".ci" / "audit.py")
assert spec is not None and spec.loader is not None
audit: Any = importlib.util.module_from_spec(spec)
spec.loader.exec_module(audit)


def _archive(folder: Path, *advisories: dict[str, Any]) -> Path:
    with zipfile.ZipFile(folder / "all.zip", "w") as zipped:
        for advisory in advisories:
            zipped.writestr(f"{advisory['id']}.json", json.dumps(advisory))
    return folder / "all.zip"


def _advisory(name: str, *events: dict[str, str], **changed: Any) -> dict[str, Any]:
    package = {"ecosystem": "PyPI", "name": name}
    affected = {"package": package, "ranges": [{"type": "ECOSYSTEM", "events": list(events)}]}
    return {"id": f"PYSEC-{name}", "modified": "2026-03-01", "affected": [affected]} | changed


@pytest.mark.parametrize(
    ("events", "version", "affected"),
    [
        ([{"introduced": "0"}, {"fixed": "2.0"}], "1.9", True),
        ([{"introduced": "0"}, {"fixed": "2.0"}], "2.0", False),
        ([{"introduced": "1.5"}, {"last_affected": "1.9"}], "1.9", True),
        ([{"introduced": "1.5"}, {"last_affected": "1.9"}], "1.10", False),
        ([{"introduced": "1.5"}], "1.4.9", False),
        ([{"introduced": "3.0"}, {"introduced": "0"}, {"fixed": "2.0"}], "3.1", True),
    ],
)
def test_a_version_is_affected_from_introduced_until_before_fixed(
    events: list[dict[str, str]], version: str, affected: bool
) -> None:
    ranges = {"ranges": [{"type": "ECOSYSTEM", "events": events}]}
    assert audit.affects(ranges, version) is affected


def test_offline_every_version_is_checked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lock = tmp_path / "a.lock"
    lock.write_text("Some_Name==1.9 ; python_version < '4' \\\n    --hash=sha256:00\nother==1.0\n")
    bad = _advisory("some-name", {"introduced": "0"}, {"fixed": "2"})
    withdrawn = _advisory("other", {"introduced": "0"}, withdrawn="2026-01-01")
    assert audit.main([str(lock), "--advisories", str(_archive(tmp_path, bad, withdrawn))]) == 1
    said = capsys.readouterr().out
    assert "some-name 1.9: PYSEC-some-name" in said
    assert "2 locked, 2 checked by all.zip, its newest advisory of 2026-03-01" in said
    assert audit.main([str(lock), "--advisories", str(_archive(tmp_path, withdrawn))]) == 0


def test_what_was_not_checked_is_named_and_the_exit_code_says_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    made = audit.Audit("a public service", checked={"a"})
    assert audit.report({"a": "1", "b": "2"}, made) == 3
    assert "b 2: not checked\n" in capsys.readouterr().out


def test_an_archive_of_something_else_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "all.zip").write_bytes(b"no zip")
    assert audit.main(["--advisories", str(tmp_path / "all.zip")]) == 2
    assert "holds no advisories in the OSV format" in capsys.readouterr().err
