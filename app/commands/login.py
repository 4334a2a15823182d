"""`handscope login`: print a new one-time address for a server that runs."""

import argparse
from pathlib import Path

from handscope.app.commands.words import default_data, say
from handscope.estimators.errors import InputError
from handscope.sessions.store.logins import new_token


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "--data",
        type=Path,
        default=default_data(),
        metavar="DIR",
        help="the server's data folder (%(default)s)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    try:
        base = (arguments.data / "address").read_text().strip()
    except OSError:
        raise InputError("command.no_server_yet", data=arguments.data) from None
    say(f"{base}/login?token={new_token(arguments.data)}")
    return 0
