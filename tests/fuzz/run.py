"""`make fuzz`: every target for a while, guided by which lines the input reaches (atheris); `python -m tests.fuzz.run --seconds 600 wire bids`.

A finding is kept in tests/fuzz/found/TARGET/, from where the tests run it ever after. Each target has a process of its own, which ends at its first finding.
"""

import argparse
import hashlib
import os
import re
import subprocess
import sys
import time
import traceback
from pathlib import Path

FOUND = Path(__file__).parent / "found"
INSTRUMENTED = [
    "handscope.sessions",
    "handscope.app.protocols",
    "handscope.app.devices.relay",
    "handscope.app.exporting.fhir_server",
    "handscope.sessions.formats.qualisys",
    "c3d",
    "cobs",
    "mcap",
    "openpyxl",
    "pyxdf",
    "zipfile",
    "json",
]
LONGEST = 2**17  # bytes of an input


def main() -> int:
    parser = argparse.ArgumentParser(description="Bad input by the thousand.")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--seconds", type=int, default=60, help="for each target")
    parser.add_argument(
        "--corpus", type=Path, default=Path(".fuzz"), help="what was worth keeping of earlier runs"
    )
    parser.add_argument("--one", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        return _fuzz(arguments.one, arguments.seconds, arguments.corpus)
    from tests.fuzz.targets import TARGETS

    bad = 0
    for name in arguments.names or TARGETS:
        words = [
            sys.executable,
            "-m",
            "tests.fuzz.run",
            "--one",
            name,
            "--seconds",
            str(arguments.seconds),
            "--corpus",
            str(arguments.corpus),
        ]
        began, done = time.monotonic(), subprocess.run(words, capture_output=True, text=True)
        runs = re.findall(r"^#(\d+)", done.stderr, re.M)
        covered = re.findall(r"cov: (\d+)", done.stderr)
        told = f"{runs[-1] if runs else '?'} inputs, {covered[-1] if covered else '?'} branches reached, {time.monotonic() - began:.0f} s"
        print(  # noqa: T201
            f"{name:12} {told}: {'nothing found' if done.returncode == 0 else 'FOUND'}", flush=True
        )
        if done.returncode:
            bad = 1
            print("\n".join(done.stderr.splitlines()[-25:]), flush=True)  # noqa: T201
    return bad


def _fuzz(name: str, seconds: int, corpus: Path) -> int:
    import atheris  # no dependency: there is none for Windows

    from handscope.app.compile_kernels import load_kernels  # numba cannot translate what is traced

    load_kernels()
    with atheris.instrument_imports(include=INSTRUMENTED):
        from tests.fuzz import targets

        for data in targets.seeds(name):  # brings in what is imported when it is first needed
            targets.run(name, data)
    begin = corpus / name
    begin.mkdir(parents=True, exist_ok=True)
    for data in targets.seeds(name):
        (begin / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)

    def one(data: bytes) -> None:
        try:
            targets.run(name, data)
        except BaseException:
            (FOUND / name).mkdir(parents=True, exist_ok=True)
            (FOUND / name / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)
            traceback.print_exc()
            sys.stderr.flush()
            os._exit(77)

    words = [
        f"-max_total_time={seconds}",
        f"-max_len={LONGEST}",
        "-rss_limit_mb=3000",
        f"-timeout={2 * targets.HANG}",
        "-print_final_stats=1",
    ]
    atheris.Setup([sys.argv[0], *words, str(begin)], one)
    atheris.Fuzz()
    return 0


if __name__ == "__main__":
    sys.exit(main())
