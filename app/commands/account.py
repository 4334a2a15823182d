"""`handscope account`: who may log in, and as what; while the server runs or not."""

import argparse
import getpass
import sys
from collections.abc import Sequence

from sqlalchemy.orm import Session

from handscope.app.commands.audit import open_audited
from handscope.app.commands.words import add_actions, say
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts, audit, second_factors
from handscope.sessions.clinic.accounts import LOCAL
from handscope.sessions.db.roles import ROLES
from handscope.sessions.login import logins
from handscope.sessions.wards import wards

ACTIONS = {
    "add": "a new account; prints a one-time address with which its owner sets a password",
    "list": "all accounts with their roles",
    "role": "give an account these roles and no others",
    "ward": "let an account belong to these wards and no others ('all' is the whole house)",
    "disable": "take an account out of use and end its logins",
    "enable": "take it into use again",
    "password": "set a password: asked for on a terminal, else read from standard input",
    "reset": "take all second factors of an account out of use, and end its logins",
    "code": "print a one-time address that logs in as the account",
}


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    for action, sub in add_actions(parser, ACTIONS):
        if action in ("add", "role"):
            sub.add_argument(
                "--role",
                action="append",
                required=True,
                choices=ROLES,
                help="may be given more than once",
            )
        if action in ("add", "ward"):
            sub.add_argument(
                "--ward",
                action="append",
                required=action == "ward",
                default=None,
                metavar="WARD",
                help="whose patients the account sees; may be given more than once",
            )
        if action == "ward":
            sub.add_argument(
                "--head",
                action="append",
                default=[],
                metavar="WARD",
                help="of these wards the account is shown emergency accesses",
            )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    with open_audited(arguments.data, arguments.database) as db:
        if arguments.action == "list":
            for account in accounts.list_accounts(db):
                named = ", ".join(m.ward.name for m in account.memberships)
                state = "  out of use" if account.disabled else ""
                say(f"{account.name:24} {', '.join(account.roles):36} wards: {named}{state}")
        elif arguments.action == "add":
            numbers = _numbers(db, arguments.ward)
            account = accounts.add(db, arguments.name, arguments.role)
            if numbers is not None:
                wards.assign(db, account, numbers)
            _say_code(db, arguments)
        else:
            _change(db, arguments)
    return 0


def _change(db: Session, arguments: argparse.Namespace) -> None:
    account = accounts.find_by_name(db, arguments.name)
    if arguments.action == "role":
        accounts.change(db, account, roles=arguments.role)
    elif arguments.action == "ward":
        numbers = _numbers(db, arguments.ward) or []
        wards.assign(db, account, numbers, _numbers(db, arguments.head) or [])
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
        accounts.set_password(db, account, _ask_password())
        logins.end_all(db, account)


def _numbers(db: Session, names: Sequence[str] | None) -> list[int] | None:
    """Numbers of wards by their names; InputError where there is none of a name."""
    return None if names is None else [wards.find_by_name(db, name).id for name in names]


def _say_code(db: Session, arguments: argparse.Namespace) -> None:
    """Under the address that the server runs at, or ran at last."""
    account = accounts.find_by_name(db, arguments.name)
    if account.disabled:
        raise InputError("command.account_disabled", name=account.name)
    place = arguments.data / "address"
    base = place.read_text().strip() if place.exists() else ""
    say(f"{base}/login?token={logins.new_token(arguments.data, account.name)}")


def _ask_password() -> str:
    if not sys.stdin.isatty():
        return sys.stdin.readline().rstrip("\n")
    password = getpass.getpass("New password: ")
    if getpass.getpass("Once more: ") != password:
        raise InputError("command.passwords_differ")
    return password
