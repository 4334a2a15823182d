"""`handscope account`: who may log in, and as what; while the server runs or not."""

import argparse
import getpass
import sys

from sqlalchemy.orm import Session

from handscope.app.commands.audit import open_audited
from handscope.app.commands.words import add_store, say
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts, audit, second_factors
from handscope.sessions.clinic.accounts import LOCAL, ROLES
from handscope.sessions.store import logins

ACTIONS = {
    "add": "a new account; prints a one-time address with which its owner sets a password",
    "list": "all accounts with their roles",
    "role": "give an account these roles and no others",
    "disable": "take an account out of use and end its logins",
    "enable": "take it into use again",
    "password": "set a password: asked for on a terminal, else read from standard input",
    "reset": "take all second factors of an account out of use, and end its logins",
    "code": "print a one-time address that logs in as the account",
}


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for action, meaning in ACTIONS.items():
        sub = actions.add_parser(action, help=meaning, description=meaning)
        add_store(sub)
        if action != "list":
            sub.add_argument("name", metavar="NAME")
        if action in ("add", "role"):
            sub.add_argument(
                "--role",
                action="append",
                required=True,
                choices=ROLES,
                help="may be given more than once",
            )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    with open_audited(arguments.data, arguments.database) as db:
        if arguments.action == "list":
            for account in accounts.list_accounts(db):
                say(
                    f"{account.name:24} {', '.join(account.roles)}{'  out of use' if account.disabled else ''}"
                )
        elif arguments.action == "add":
            accounts.add(db, arguments.name, arguments.role)
            _say_code(db, arguments)
        else:
            _change(db, arguments)
    return 0


def _change(db: Session, arguments: argparse.Namespace) -> None:
    account = accounts.find_by_name(db, arguments.name)
    if arguments.action == "role":
        accounts.change(db, account, roles=arguments.role)
    elif arguments.action in ("disable", "enable"):
        accounts.change(db, account, disabled=arguments.action == "disable")
        if account.disabled:
            logins.end_all(db, account)
    elif arguments.action == "reset":
        second_factors.remove_all(db, account)
        logins.end_all(db, account)
    elif arguments.action == "code":
        audit.record(db, audit.AuditEvent("created", "code", str(account.id)))
        db.commit()
        _say_code(db, arguments)
    else:
        if account.name == LOCAL or account.subject is not None:
            raise InputError("command.account_without_password", name=account.name)
        accounts.set_password(db, account, _asked())
        logins.end_all(db, account)


def _say_code(db: Session, arguments: argparse.Namespace) -> None:
    """Under the address that the server runs at, or ran at last."""
    account = accounts.find_by_name(db, arguments.name)
    if account.disabled:
        raise InputError("command.account_disabled", name=account.name)
    place = arguments.data / "address"
    base = place.read_text().strip() if place.exists() else ""
    say(f"{base}/login?token={logins.new_token(arguments.data, account.name)}")


def _asked() -> str:
    if not sys.stdin.isatty():
        return sys.stdin.readline().rstrip("\n")
    password = getpass.getpass("New password: ")
    if getpass.getpass("Once more: ") != password:
        raise InputError("command.passwords_differ")
    return password
