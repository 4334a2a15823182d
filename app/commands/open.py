"""`handscope open`: the pages in a browser that is logged in; a server is started where none runs on the data folder."""

import argparse
import webbrowser
from pathlib import Path

from handscope.app.commands import serve
from handscope.app.commands.words import say
from handscope.estimators.errors import InputError
from handscope.sessions.store.folder_lock import hold_folder
from handscope.sessions.store.logins import new_token


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb: those of a server, which count where one is started."""
    serve.add(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    try:
        with hold_folder(arguments.data, arguments.database):
            serve.serve(arguments, {}, browser=True, printed=False)
    except InputError:
        address = _running_server(arguments.data)
        if address is None:
            raise
        webbrowser.open(f"{address}/login?token={new_token(arguments.data)}")
        say(f"Handscope runs already at {address}; the browser was opened")
    return 0


def _running_server(data: Path) -> str | None:
    """The address of the server that holds the folder; None where it wrote none."""
    try:
        return (data / "address").read_text().strip() or None
    except OSError:
        return None
