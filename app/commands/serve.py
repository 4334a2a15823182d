"""`handscope serve`: pages, API and 3-D scene on one port."""

import argparse
import os
import sys
from pathlib import Path

from handscope.app.auth.sign_on_scope import SCOPE
from handscope.app.commands.words import FOLDER, database_url, default_data
from handscope.sessions.db.roles import ROLES

DEFAULT_PORT = 8420
IDLE, LONGEST = 4.0, 24.0  # h of a login
CACHE = 20.0  # GB


def add(parser: argparse.ArgumentParser, folder: str = FOLDER) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="H",
        help="address to listen on (loopback unless told otherwise)",
    )
    parser.add_argument(
        "--port",
        type=int,
        default=DEFAULT_PORT,
        metavar="P",
        help=f"port ({DEFAULT_PORT}; 0 takes a free one)",
    )
    parser.add_argument(
        "--data",
        type=Path,
        default=default_data(folder),
        metavar="DIR",
        help="data folder (%(default)s)",
    )
    parser.add_argument(
        "--database",
        default=database_url(),
        metavar="URL",
        help="SQLAlchemy URL of the database (HANDSCOPE_DATABASE, or SQLite in the data folder)",
    )
    parser.add_argument(
        "--recordings",
        default=os.environ.get("HANDSCOPE_RECORDINGS") or None,
        metavar="URL",
        help="object storage that closed recordings are moved to (HANDSCOPE_RECORDINGS): s3://bucket/folder; asked for once, kept in the data folder",
    )
    parser.add_argument(
        "--shared",
        action="store_true",
        default=os.environ.get("HANDSCOPE_SHARED") == "1",
        help="one of several servers on the same PostgreSQL database and object storage (HANDSCOPE_SHARED=1); asked for once, kept in the data folder",
    )
    parser.add_argument(
        "--scheduler",
        default=os.environ.get("HANDSCOPE_SCHEDULER") or None,
        metavar="ADDRESS",
        help="of a Dask cluster that makes reports, exports and self-calibrations (HANDSCOPE_SCHEDULER), such as tls://head:8786; its workers see the same data folder and database",
    )
    parser.add_argument(
        "--cache",
        type=_gigabytes,
        default=CACHE,
        metavar="GB",
        help="most of what is there that this disk keeps as well (%(default)s)",
    )
    parser.add_argument(
        "--metrics",
        type=_place,
        metavar="[HOST:]PORT",
        help="figures for Prometheus, without a login (loopback unless told otherwise)",
    )
    parser.add_argument(
        "--name",
        action="append",
        default=[],
        metavar="HOST",
        help="another name under which browsers reach the server",
    )
    parser.add_argument(
        "--allow-port",
        action="append",
        default=[],
        metavar="PATTERN",
        help="network addresses that pages may open as a glove's port, as a shell pattern: socket://10.1.2.*:4000 (default: none)",
    )
    parser.add_argument(
        "--allow-outlet",
        action="append",
        default=[],
        metavar="PATTERN",
        help="where sessions may send poses: lsl (anybody in the network can read it), osc://10.1.2.*:9000 (default: nowhere)",
    )
    parser.add_argument(
        "--proxy",
        action="append",
        default=[],
        metavar="IP",
        help="a reverse proxy whose X-Forwarded-For and -Proto are believed",
    )
    parser.add_argument(
        "--oidc-issuer",
        default=os.environ.get("HANDSCOPE_OIDC_ISSUER"),
        metavar="URL",
        help="single sign-on: OpenID Connect provider",
    )
    parser.add_argument(
        "--oidc-client",
        default=os.environ.get("HANDSCOPE_OIDC_CLIENT") or "handscope",
        metavar="ID",
        help="our name there (%(default)s); the secret is in HANDSCOPE_OIDC_SECRET",
    )
    parser.add_argument(
        "--oidc-claim",
        default=os.environ.get("HANDSCOPE_OIDC_CLAIM") or "roles",
        metavar="NAME",
        help="claim that holds the roles (%(default)s)",
    )
    parser.add_argument(
        "--oidc-scope",
        default=os.environ.get("HANDSCOPE_OIDC_SCOPE") or SCOPE,
        metavar="WORDS",
        help="what is asked for (%(default)s); some providers tell roles only where their scope is named, too",
    )
    parser.add_argument(
        "--oidc-role",
        action="append",
        default=[],
        metavar="WORD=ROLE",
        help="a word of that claim and the role that it means (HANDSCOPE_OIDC_ROLES, several with spaces between); without any, the roles' own names",
    )
    parser.add_argument(
        "--second-factor",
        action="append",
        default=[],
        choices=ROLES,
        metavar="ROLE",
        help="a role whose accounts with a password need a second factor (HANDSCOPE_SECOND_FACTOR, several with spaces between)",
    )
    parser.add_argument(
        "--print-login",
        action="store_true",
        help="print the one-time address also where the output is no terminal, such as a container's log",
    )
    parser.add_argument(
        "--idle-logout",
        type=_hours,
        default=IDLE,
        metavar="HOURS",
        help="a login ends without a request for so long (%(default)s)",
    )
    parser.add_argument(
        "--longest-login",
        type=_hours,
        default=LONGEST,
        metavar="HOURS",
        help="every login ends after so long (%(default)s)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    from handscope.app.serving import serve
    from handscope.sessions.store.folder_lock import hold_folder

    printed = arguments.print_login or sys.stdout.isatty()
    with hold_folder(arguments.data, arguments.database, arguments.shared):
        serve(arguments, {}, browser=False, printed=printed)
    return 0


def _hours(word: str) -> float:
    hours = float(word)
    if not 0 < hours <= 24 * 366:
        raise ValueError
    return hours


def _gigabytes(word: str) -> float:
    size = float(word)
    if not 0 <= size < 1e6:
        raise ValueError
    return size


def _place(word: str) -> tuple[str, int]:
    host, _, port = word.rpartition(":")
    if not (port.isdecimal() and 0 < int(port) <= 65535):
        raise argparse.ArgumentTypeError(f"{word} is no [HOST:]PORT")
    return host.strip("[]") or "127.0.0.1", int(port)
