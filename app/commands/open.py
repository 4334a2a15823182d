"""`handscope open`: the pages in a browser that is logged in; a server is started where none runs on the data folder."""

import argparse
import webbrowser

from handscope.app.commands import serve
from handscope.app.commands.words import say
from handscope.estimators.errors import InputError


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb: server options; used only if a server is started."""
    serve.add(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    from handscope.app import serving
    from handscope.app.commands.login import one_time_address, running_server
    from handscope.sessions.store.folder_lock import hold_folder

    try:
        with hold_folder(arguments.data, arguments.database, arguments.shared):
            serving.serve(arguments, {}, browser=True, printed=False)
    except InputError:
        address = running_server(arguments.data)
        if not address:
            raise
        webbrowser.open(one_time_address(address, arguments.data))
        say(f"Handscope runs already at {address}; the browser was opened")
    return 0
