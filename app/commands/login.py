"""`handscope login`: print a new one-time address for a server that runs."""

import argparse
from pathlib import Path

from handscope.app.commands.words import default_data, say
from handscope.estimators.errors import InputError


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
    base = running_server(arguments.data)
    if base is None:
        raise InputError("command.no_server_yet", data=arguments.data)
    say(one_time_address(base, arguments.data))
    return 0


def running_server(data: Path) -> str | None:
    """The address of the server that serves the folder, as it wrote it; None where it wrote none."""
    try:
        return (data / "address").read_text().strip()
    except OSError:
        return None


def one_time_address(base: str, data: Path) -> str:
    """An address of the server that logs in once."""
    from handscope.sessions.login.logins import new_token  # here: not for --help

    return f"{base}/login?token={new_token(data)}"
