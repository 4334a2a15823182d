"""What we write is valid BIDS by the validator of the standard, without a network."""

import json
import os
import subprocess
import sysconfig
from pathlib import Path

import pytest

from handscope.sessions import motion_bids
from tests.bids import BASE, dataset, folder, recording, with_line

VALIDATOR = Path(sysconfig.get_path("scripts")) / "bids-validator-deno"


def faults(place: Path) -> list[str]:
    nowhere = dict.fromkeys(
        ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9"
    )  # it must work offline
    run = subprocess.run(
        [VALIDATOR, place, "--json"],
        capture_output=True,
        text=True,
        env={**os.environ, **nowhere, "NO_COLOR": "1"},
        check=False,
    )
    issues = json.loads(run.stdout)["issues"]["issues"]
    return [
        f"{issue['code']} {issue.get('location', '')}"
        for issue in issues
        if issue["severity"] == "error"
    ]


@pytest.mark.parametrize("session", [None, "01"])
def test_the_validator_finds_no_error_in_what_is_written(
    tmp_path: Path, session: str | None
) -> None:
    motion_bids.write(recording(), tmp_path, session=session)
    assert faults(tmp_path) == []


def test_the_validator_would_find_one(tmp_path: Path) -> None:
    place = folder(
        with_line(
            dataset(),
            "_tracksys-index_channels.tsv",
            2,
            lambda line: line.replace("LATENCY", "TIME"),
        ),
        tmp_path,
    )
    assert any(BASE in fault for fault in faults(place))
