"""The command line: `handscope VERB ...`. A user's mistake is one line on standard error and exit code 2."""

import argparse
import gc
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, NoReturn

from handscope.app.version import software_version
from handscope.app.workers.garbage import GARBAGE
from handscope.estimators.errors import InputError

VERBS = {
    "demo": "serve with a virtual glove and a demonstration patient",
    "serve": "serve pages, API and 3-D scene",
    "open": "open the pages in a browser, logged in; start a server where none runs",
    "desktop-entry": "an icon in the menu of a Linux desktop that opens the pages",
    "account": "who may log in, and as what",
    "ward": "parts of the hospital that patients and accounts belong to",
    "audit": "who saw, changed, exported and erased what; verify that nobody changed the trail",
    "servers": "the servers that share a database; retire one that never comes back",
    "login": "print a new one-time address for a server that runs",
    "backup": "everything in the data folder as one checked file, while the server runs",
    "restore": "put a backup into an empty data folder",
    "backup-key": "make the key of encrypted backups, and seal backups for another one",
    "data-key": "make the key that seals a data folder, seal what lies there, change the key",
    "glove": "a virtual glove behind a pseudo-terminal",
    "record": "record a glove without the pages, with the live tracker running",
    "doctor": "who is at a port, and is it well? ends in pass or in what to mend",
    "simulate": "write a simulated recording as Motion-BIDS, with the truth beside it",
    "samples": "small simulated recordings with their truth, to try things on",
    "process": "run a method over a recording",
    "compare": "how far two recordings of one movement agree",
    "assess": "measures of a recording as JSON and CSV, and a report",
    "pose-sheet": "the sheet on which a hand is laid and photographed, as PDF at true scale",
    "photograph": "lengths and angles of a hand from a photograph of it on the sheet",
    "calibrate-strip": "calibrate strips laid down in six or more positions, and write it to their flash",
    "calibrate-force": "what a fingertip's force sensor reads, from loads that are known",
    "locate": "where a magnet is, from the recording of any magnetometer array",
    "learn-magnet": "where magnetometers and magnet sit, from half a minute of movement",
    "info": "say what a recording holds and what was cut",
    "import": "a table of any logger as a recording, by a map of its columns",
    "export": "write a recording or its movement as files of other programs",
    "bench": "speed and memory of the hot paths",
    "reproduce": "the figures that the papers report, measured again on simulated and real recordings",
}
MODULES = {"import": "import_table"}  # where a verb is no name for a module
CLOSED_PIPE = 141  # as a shell has it for SIGPIPE
EVIDENCE = {"bench", "reproduce"}  # verbs of handscope.validation


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one line; its help may depend on the words given."""

    given: Sequence[str] = ()
    epilog_for: Callable[[Sequence[str]], str] | None = None

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        self.given = list(args or ())
        return super().parse_known_args(args, namespace)

    def format_help(self) -> str:
        if self.epilog_for is not None:
            self.epilog = self.epilog_for(self.given)
        return super().format_help()

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def main(words: Sequence[str] | None = None) -> int:
    """Run a command; the exit code. Ctrl-C ends it without a word at any time, while its modules are being read, too."""
    try:
        return _done(words)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # whoever read the output has left, such as `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CLOSED_PIPE


def _done(words: Sequence[str] | None) -> int:
    # matrices are small: more threads wait for each other
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # no process that this one starts imports files of the folder it was started in
    os.environ["PYTHONSAFEPATH"] = "1"
    gc.set_threshold(*GARBAGE)
    given = list(sys.argv[1:] if words is None else words)
    parser = Parser(
        prog="handscope",
        description="Measure how a hand moves.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"handscope {software_version()}")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", parser_class=Parser)
    wanted = next((w for w in given if not w.startswith("-")), "")
    for verb, meaning in VERBS.items():
        sub = verbs.add_parser(
            verb,
            help=meaning,
            description=meaning,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if verb == wanted:  # only the verb asked for is imported: the others' imports cost time
            room = "validation" if verb in EVIDENCE else "app"
            name = MODULES.get(verb, verb.replace("-", "_"))
            module = import_module(f"handscope.{room}.commands.{name}")
            module.add(sub)
            sub.set_defaults(run=module.run)
    arguments = parser.parse_args(given)
    try:
        return int(arguments.run(arguments) or 0)
    except InputError as mistake:
        print(f"handscope {arguments.verb}: {mistake}", file=sys.stderr)  # noqa: T201  the user's answer
        return 2
    except Exception as problem:
        from handscope.sessions.db.full_disk import FULL, is_full

        if not is_full(problem):
            raise
        print(f"handscope {arguments.verb}: {FULL}", file=sys.stderr)  # noqa: T201
        return 2


if __name__ == "__main__":
    sys.exit(main())
