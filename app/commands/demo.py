"""`handscope demo`: serve with virtual gloves, a demonstration patient and simulated ones with months of sessions; nothing but a browser is needed."""

import argparse
import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from functools import partial

from handscope.app.commands import serve
from handscope.app.commands.words import say
from handscope.estimators.errors import InputError

GLOVES = ("left", "right")
NOTE = "A simulated person with a virtual glove on either hand."
EXAMPLES = "handscope.app.example_patients.sessions"  # a program that imports numerics
FOLDER = "handscope-demo"  # in the user's home: nobody's real patients are there


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    serve.add(parser, FOLDER)
    parser.add_argument(
        "--strips",
        default="all",
        metavar="NAMES",
        help="of the virtual gloves, as `handscope glove` has them: all,trunk",
    )
    parser.add_argument(
        "--rate", default="100", metavar="HZ", help="of the virtual gloves' samples (100)"
    )
    parser.add_argument(
        "--no-examples",
        action="store_true",
        help="a new data folder gets no simulated patients",
    )
    parser.add_argument("--no-browser", action="store_true", help="do not open a browser")


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    from handscope.sessions.store.folder_lock import hold_folder

    with hold_folder(arguments.data, arguments.database, arguments.shared):
        _add_patients(arguments)
        _serve(arguments)
    say("stopped")
    return 0


def _add_patients(arguments: argparse.Namespace) -> None:
    from handscope.app.example_patients import patients as example_patients
    from handscope.sessions.clinic import patients
    from handscope.sessions.db.tables import Patient
    from handscope.sessions.store.store import open_store

    store, is_new = open_store(arguments.data, arguments.database), False
    with store.database() as db:
        if db.query(Patient).count() == 0:
            patients.create(
                db,
                "DEMO",
                confirmed=True,
                dominant_hand="right",
                affected_hand="left",
                year_of_birth=1960,
                note=NOTE,
            )
            is_new = True
    if is_new and not arguments.no_examples:
        example_patients.add_patients(store)
    store.close()


def _serve(arguments: argparse.Namespace) -> None:
    from handscope.app import serving

    # as Ctrl-C does: what is below is undone
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    with ExitStack() as gloves:
        put_up = _terminals if hasattr(os, "openpty") else _addresses
        ports = zip(put_up(arguments, gloves), (f"virtual {hand} glove" for hand in GLOVES))
        examples = partial(_make_examples, arguments, gloves)
        serving.serve(
            arguments,
            dict(ports),
            browser=not arguments.no_browser,
            printed=True,
            on_ready=examples,
        )


def _make_examples(arguments: argparse.Namespace, processes: ExitStack) -> None:
    """The simulated patients' sessions, where some are to be made, in a process of low priority beside the server: one by one they appear on the pages."""
    from handscope.app.example_patients import patients as example_patients

    if not example_patients.are_unfinished(arguments.data):
        return
    program = [sys.executable, "-P", "-m", EXAMPLES, str(arguments.data)]
    database = ["--database", arguments.database] if arguments.database else []
    process = subprocess.Popen([*program, *database], stdin=subprocess.DEVNULL)
    processes.callback(process.wait)
    processes.callback(process.terminate)


def _terminals(arguments: argparse.Namespace, gloves: ExitStack) -> tuple[str, ...]:
    """A glove a hand behind pseudo-terminals in the data folder, until `gloves` is closed."""
    folder = arguments.data / "gloves"
    folder.mkdir(exist_ok=True)
    paths = [folder / f"virtual-{hand}-glove" for hand in GLOVES]
    for path in paths:
        path.unlink(missing_ok=True)
        gloves.callback(path.unlink, missing_ok=True)
    processes = _start(arguments, gloves, [["--pty", str(path)] for path in paths])
    while not all(path.is_symlink() for path in paths):  # slow ones are waited for
        if any(p.poll() is not None for p in processes):
            raise InputError("command.demo_gloves_pty", folder=folder)
        time.sleep(0.05)
    return tuple(str(path) for path in paths)


def _addresses(arguments: argparse.Namespace, gloves: ExitStack) -> tuple[str, ...]:
    """The same over TCP, for systems without pseudo-terminals."""
    processes = _start(arguments, gloves, [["--tcp", "127.0.0.1:0"]] * len(GLOVES))
    first = [p.stdout.readline().decode() if p.stdout else "" for p in processes]
    ports = tuple(line.split()[-1] if "socket://" in line else "" for line in first)
    if not all(ports):
        raise InputError("command.demo_gloves_tcp")
    return ports


def _start(
    arguments: argparse.Namespace, gloves: ExitStack, where: list[list[str]]
) -> "list[subprocess.Popen[bytes]]":
    """A process a glove; all are ended before the links are taken away."""
    program = [sys.executable, "-P", "-m", "handscope.app.cli", "glove"]
    of_both = ["--strips", arguments.strips, "--rate", arguments.rate]
    processes = [
        subprocess.Popen(
            [*program, *place, "--hand", hand, "--seed", str(k), *of_both],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE if "--tcp" in place else subprocess.DEVNULL,
        )
        for k, (hand, place) in enumerate(zip(GLOVES, where))
    ]
    for process in processes:
        gloves.callback(process.wait)
    for process in processes:
        gloves.callback(process.terminate)
    return processes
