"""`handscope demo`: serve with virtual gloves and a demonstration patient; nothing but a browser is needed."""

import argparse
import signal
import subprocess
import sys
import time
from pathlib import Path

from handscope.app.commands import serve
from handscope.app.commands.words import say
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import patients
from handscope.sessions.db.tables import Patient
from handscope.sessions.store.store import open_store

GLOVES = ("left", "right")
FOLDER = "handscope-demo"  # in the user's home: nobody's real patients are there


def add(parser: argparse.ArgumentParser) -> None:
    serve.add(parser, FOLDER)
    parser.add_argument(
        "--strips",
        default="all",
        metavar="NAMES",
        help="of the virtual gloves, as `handscope glove` has them: all,trunk",
    )
    parser.add_argument("--no-browser", action="store_true", help="do not open a browser")


def run(arguments: argparse.Namespace) -> int:
    store = open_store(arguments.data, arguments.database)
    with store.database() as db:
        if db.query(Patient).count() == 0:
            patients.create(
                db,
                "Demo patient",
                confirmed=True,
                dominant_hand="right",
                affected_hand="left",
                year_of_birth=1960,
                note="A simulated person with a virtual glove on either hand.",
            )
    gloves = arguments.data / "gloves"
    gloves.mkdir(exist_ok=True)
    signal.signal(
        signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM)
    )  # as Ctrl-C does: what is below is undone
    paths = [gloves / f"virtual-{hand}-glove" for hand in GLOVES]
    processes = [
        _glove(path, hand, seed, arguments.strips)
        for seed, (path, hand) in enumerate(zip(paths, GLOVES))
    ]
    try:
        _wait(paths, processes)
        serve.serve(arguments, tuple(str(p) for p in paths), browser=not arguments.no_browser)
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()
        for path in paths:
            path.unlink(missing_ok=True)
    say("stopped")
    return 0


def _glove(path: Path, hand: str, seed: int, strips: str) -> "subprocess.Popen[bytes]":
    path.unlink(missing_ok=True)
    words = [
        sys.executable,
        "-P",
        "-m",
        "handscope.app.cli",
        "glove",
        "--pty",
        str(path),
        "--hand",
        hand,
        "--seed",
        str(seed),
        "--strips",
        strips,
    ]
    return subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)


def _wait(paths: list[Path], processes: "list[subprocess.Popen[bytes]]") -> None:
    """A glove that is slow, on a machine that is busy, is waited for; one that ended is not."""
    while not all(path.is_symlink() for path in paths):
        if any(p.poll() is not None for p in processes):
            raise InputError(
                "the virtual gloves did not start; does this system have pseudo-terminals?"
            )
        time.sleep(0.05)
