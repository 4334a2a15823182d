"""`handscope ward`: parts of the hospital that patients and accounts belong to; while the server runs or not."""

import argparse

from handscope.app.commands.audit import open_audited
from handscope.app.commands.words import add_actions, say
from handscope.sessions.db.tables import HOUSE
from handscope.sessions.wards import wards

ACTIONS = {
    "add": "a new ward, without patients and accounts",
    "list": "all wards",
    "rename": "another name",
    "remove": "remove a ward that no patient belongs to; its accounts leave it",
}


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    for action, sub in add_actions(parser, ACTIONS):
        if action == "rename":
            sub.add_argument("other", metavar="NEW_NAME")


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    with open_audited(arguments.data, arguments.database) as db:
        if arguments.action == "list":
            for ward in wards.list_wards(db):
                say(f"{ward.name}{'  (the whole house)' if ward.id == HOUSE else ''}")
        elif arguments.action == "add":
            wards.add(db, arguments.name)
        else:
            ward = wards.find_by_name(db, arguments.name)
            if arguments.action == "rename":
                wards.rename(db, ward.id, arguments.other)
            else:
                wards.remove(db, ward.id)
    return 0
