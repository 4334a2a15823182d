"""A cohort: every recording as `process` alone makes it, the broken ones named, nothing done twice."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from handscope.app.cli import main
from handscope.app.exporting import cohort
from handscope.estimators.errors import InputError
from handscope.sessions.motion_bids import writer
from tests.oriented import fused
from tests.simulated import loaded, pose_and_wiggle

pytest.importorskip("distributed", reason="Dask is not installed: make lock, then make check")


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    """Two good ones and a broken one."""
    folder = tmp_path / "cohort"
    (folder / "second").mkdir(parents=True)
    packed = writer.pack(writer.tree(loaded(pose_and_wiggle("left")), "01", "wiggle"))
    for name in ("a.zip", "second/b.zip"):
        (folder / name).write_bytes(packed)
    (folder / "broken.zip").write_bytes(packed[:1000])
    return folder


def test_a_cohort_is_processed_once_and_what_failed_is_named(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [
        "process",
        "--cohort",
        str(recordings),
        "--method",
        "m2",
        "--out",
        str(tmp_path / "out"),
        "--workers",
        "1",
    ]
    assert main(words) == 1
    told = capsys.readouterr().out
    assert (
        "FAILED broken: broken.zip" in told
        and "2 recordings by m2" in told
        and "0 of them done before; 1 failed" in told
    )
    assert (
        main(
            [
                "process",
                str(recordings / "a.zip"),
                "--method",
                "m2",
                "--out",
                str(tmp_path / "alone"),
            ]
        )
        == 0
    )
    alone, ours = (
        {p.relative_to(d): p.read_bytes() for p in d.rglob("*_motion.tsv")}
        for d in (tmp_path / "alone", tmp_path / "out" / "a")
    )
    assert alone == ours and len(ours) == 1
    assert not (tmp_path / "out" / "broken").exists()
    works = [
        cohort.Work(n, str(p), str(tmp_path / "out"), "m2", {}, None)
        for n, p in cohort.recordings(recordings).items()
    ]
    assert [cohort.one(w).state for w in works] == ["before", "failed", "before"]
    assert (
        cohort.one(
            cohort.Work(
                "a",
                str(recordings / "a.zip"),
                str(tmp_path / "out"),
                "m2",
                {"alignment": "heading"},
                None,
            )
        ).state
        == "done"
    ), "another option is another result"


def test_a_list_names_recordings_beside_it(recordings: Path, tmp_path: Path) -> None:
    (tmp_path / "list.txt").write_text("# two\ncohort/a.zip\n\ncohort/second/b.zip\n")
    assert list(cohort.recordings(tmp_path / "list.txt")) == ["a", "b"]
    assert list(cohort.recordings(recordings)) == ["a", "broken", "second--b"]
    (tmp_path / "list.txt").write_text("cohort/a.zip\nother/a.zip\n")
    with pytest.raises(InputError, match="two recordings of one name"):
        cohort.recordings(tmp_path / "list.txt")
    (tmp_path / "empty").mkdir()
    for place in (tmp_path / "empty", tmp_path / "nowhere"):
        with pytest.raises(InputError, match=r"no recordings|no folder"):
            cohort.recordings(place)


def test_a_result_half_written_is_made_again(recordings: Path, tmp_path: Path) -> None:
    work = cohort.Work("a", str(recordings / "a.zip"), str(tmp_path), "m2", {}, None)
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "done.json").write_text('{"key": ')
    assert cohort.one(work).state == "done"
    assert set(json.loads((tmp_path / "a" / "done.json").read_text())) == {"key", "warnings"}


def test_a_cohort_is_written_in_the_formats_of_the_exports_table(
    recordings: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    work = cohort.Work(
        "a", str(recordings / "a.zip"), str(out), "m2", {}, None, ("jsonl", "opensim")
    )
    assert cohort.one(work).state == "done" and cohort.one(work).state == "before"
    assert (out / "a" / "a.jsonl").is_file()
    assert {p.name for p in (out / "a" / "opensim").iterdir()} == {
        "motion.mot",
        "orientations.sto",
        "hand.osim",
    }
    assert cohort.one(replace(work, formats=("mat",))).state == "done"


def test_a_format_that_there_is_not_ends_before_anything_is_done(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    words = ["process", "--cohort", str(recordings), "--out", str(out), "--format", "docx"]
    assert main(words) == 2
    assert "formats are bids, opensim" in capsys.readouterr().err and not out.exists()


def test_where_no_method_is_named_each_recording_gets_the_one_that_suits_it(tmp_path: Path) -> None:
    oriented = loaded(fused(pose_and_wiggle("left")))
    (tmp_path / "q.zip").write_bytes(writer.pack(writer.tree(oriented, "01", "wiggle")))
    work = cohort.Work("q", str(tmp_path / "q.zip"), str(tmp_path / "out"), None, {}, None)
    assert cohort.one(work) == cohort.Outcome("q", "done")
    assert list((tmp_path / "out" / "q").rglob("*_desc-m2_motion.tsv"))
