"""The benchmarks' own arithmetic: what fills the database, and that every page's requests are answered."""

import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import parse_qsl

import numpy as np
import pytest
from sqlalchemy import func, select
from starlette.testclient import TestClient

from handscope import static
from handscope.app.auth.gate import new_token
from handscope.app.devices.virtual_glove.firmware import Build
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.estimators.errors import InputError
from handscope.sessions.db.tables import Patient, PatientSession, RecordingFile, Result
from handscope.sessions.store.store import open_store
from handscope.validation.benchmarks import (
    BENCHES,
    Metric,
    bench,
    costs,
    gate,
    live,
    load,
    pages,
    share_of_yardstick,
    start,
)
from handscope.validation.benchmarks.server_under_test import wait_for


@pytest.mark.parametrize("name", BENCHES)
def test_every_benchmark_can_be_loaded(name: str) -> None:
    assert callable(bench(name))


def test_the_pages_are_measured_on_as_many_rows_as_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pages, "PATIENTS", 60)
    monkeypatch.setattr(pages, "SESSIONS", 300)
    monkeypatch.setattr(pages, "MINUTE", ("initial_pose", "tapping"))
    store = open_store(tmp_path)
    pages.fill(store)
    with store.database() as db:
        counts = [
            db.scalar(select(func.count(table.id)))
            for table in (Patient, PatientSession, RecordingFile, Result)
        ]
        assert counts == [60, 300, 300, 300]
        busiest = db.scalar(
            select(func.count(PatientSession.id)).where(PatientSession.patient_id == 1)
        )
        assert busiest == pages.MANY
    with TestClient(
        create_app(Settings(data=tmp_path)), base_url="http://127.0.0.1:8420"
    ) as client:
        client.post("/api/login", json={"token": new_token(tmp_path)})
        for paths in pages.pages().values():
            for path in paths:
                assert client.get(path).status_code == 200, path
        visits = client.get("/api/patients/1").json()["sessions"]
        assert len(visits) == pages.MANY
        assert {v["calibration"]["source"] for v in visits} == {"initial pose"}


def test_the_gate_knows_worse_from_better_and_from_a_slow_hour() -> None:
    def run(yardstick: float, speed: float, lost: float) -> dict[str, list[Metric]]:
        return {"batch": [Metric("yardstick", yardstick, "x", None, "higher"), Metric("speed", speed, "x", None, "higher"), Metric("lost", lost, "", 0, "lower")]}  # fmt: skip

    allowed = {
        "batch": {"speed": gate.Allowed(0.25, 1.5, "yardstick"), "lost": gate.Allowed(0.0, 1.0)}
    }
    assert gate.find_regressions(allowed, run(2000, 500, 0)) == []
    assert gate.find_regressions(allowed, run(200, 50, 0)) == [], (
        "everything is slower: the machine is"
    )
    assert gate.find_regressions(allowed, run(2000, 350, 0)) == []
    assert [w.split(" is ")[0] for w in gate.find_regressions(allowed, run(2000, 300, 1))] == [
        "batch: speed",
        "batch: lost",
    ]
    assert gate.find_regressions(allowed, {"batch": []}) == [
        "batch: speed was not measured",
        "batch: lost was not measured",
    ]
    assert gate.find_regressions(allowed, {"pages": []}) == []


def test_a_figure_is_a_share_of_the_yardstick_of_its_unit_and_the_row_says_so() -> None:
    yardstick = Metric("VQF alone (yardstick)", 2000.0, "x", None, "higher")
    speed, memory = (
        Metric("m2 speed", 500.0, "x", None, "higher"),
        Metric("m2 memory of 10 min", 280.6, "MB", None, "lower"),
    )
    metrics = [yardstick, speed, memory]
    assert [share_of_yardstick(m, metrics) for m in metrics] == [None, 0.25, None]
    assert share_of_yardstick(speed, [speed]) is None
    row = gate.release_row("1.0", {"batch": metrics})
    assert row == "| 1.0 | 0.25 | - | 281 MB | - | - | - | - |"
    text = (Path(__file__).parents[3] / "docs/benchmarks.md").read_text("utf-8")
    table = text.partition("## Over releases")[2].split("\n\n")[2].splitlines()
    assert {line.count("|") for line in table} == {row.count("|")}


def test_processor_time_is_that_of_the_work_and_not_of_waiting() -> None:
    def work() -> None:
        time.sleep(0.02)

    assert costs.time_of_work(work) < 0.02
    idle, busy = (
        costs.time_of_python(["-c", code])
        for code in ("pass", "import time\nwhile time.process_time() < 0.3: pass")
    )
    assert idle < 0.25 < busy


def test_load_grows_until_it_is_too_late_and_what_was_in_time_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        load,
        "_under",
        lambda client, pid, stations, viewers: load.Seen(
            20.0 * viewers, 30.0 * viewers, 0.5, 0.3, 0.8, 0.6, 0.2, 600.0 + 50.0 * viewers
        ),
    )
    seen = dict(load._until_late(None, 0, ((n, ["a"]) for n in (1, 3, 5, 7))))  # type: ignore[arg-type]
    assert list(seen) == [1, 3, 5], "nothing is asked of it after 100 ms"
    assert load._most(seen) == 3.0
    assert load._growth(seen) == 50.0


def test_viewers_ask_for_what_a_page_asks_for() -> None:
    asked = dict(parse_qsl(live.AS_A_PAGE))
    page = Path(static.__file__).with_name("station").joinpath("connection.js").read_text()
    assert f"const RATE = {asked['rate']};" in page
    assert "&changes=true`" in page and asked["changes"] == "true"


def test_the_radios_part_of_a_pages_age_is_none_without_a_radio_and_its_delays_with_one() -> None:
    rng = np.random.default_rng(0)
    assert live.age_by_radio(rng, Build(forearm_delay=(0.0, 0.0))).max() < 1e-6
    assert live.age_by_radio(rng, Build(forearm_delay=(0.005, 0.005))).max() < 1e-6
    late = live.age_by_radio(rng, Build(forearm_delay=(0.005, 0.01)))
    # one burst in a hundred would be later than this alone: others wait behind it, or come with it
    assert (
        0.0 < np.median(late) < np.percentile(late, 99) == pytest.approx(5 * np.log(100), rel=0.4)
    )


def test_a_stretch_without_a_message_is_too_late() -> None:
    assert load._p99(np.array([])) > load.LATEST
    assert load._p99(np.arange(101.0)) == 99.0


def test_processor_time_and_memory_of_a_process_are_those_of_its_descendants_too() -> None:
    spin = "x = b'1' * 20_000_000; import time\nwhile time.process_time() < 0.5: pass\ninput()"
    code = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {spin!r}])"
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE) as parent:
        wait_for(lambda: costs.time_of_processes(parent.pid) > 0.3)
        assert costs.time_of_process(parent.pid) < 0.3
        assert len(costs.family(parent.pid)) == 2
        assert costs.memory_of_processes(parent.pid) > 20.0
        parent.communicate(b"\n")


def test_the_committed_baseline_is_readable(tmp_path: Path) -> None:
    pers = {a.per for allowed in gate.read(gate.BASELINE).values() for a in allowed.values()}
    assert pers == {"", "VQF alone (yardstick)", f"{start.IMPORTS} (yardstick)"}
    (tmp_path / "b.json").write_text('{"batch": {"speed": 3}}')
    with pytest.raises(InputError, match="no baseline"):
        gate.read(tmp_path / "b.json")
