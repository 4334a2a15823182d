"""`handscope servers`: the servers that share a database, and one that never comes back retired."""

import argparse

from handscope.app.commands.words import add_store, say
from handscope.estimators.errors import InputError


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_store(parser)
    parser.add_argument(
        "--retire",
        metavar="NAME",
        help="one that never comes back: what it left open is closed by the server of the data folder when that starts next",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    from handscope.sessions.store import shared_servers  # here: not for --help
    from handscope.sessions.store.store import store_at

    if not shared_servers.find_identity(arguments.data):
        raise InputError("store.server_shares_nothing", folder=str(arguments.data))
    store = store_at(arguments.data, arguments.database)
    try:
        with store.database() as db:
            if arguments.retire:
                left = shared_servers.retire(db, arguments.retire, store.server)
                say(f"{arguments.retire} is retired; sessions that it left open: {left}")
            for other in shared_servers.list_others(db, store.server):
                state = "answers" if other.answers else "does not answer"
                say("\t".join((other.name, other.address or "address not known", state)))
    finally:
        store.close()
    return 0
