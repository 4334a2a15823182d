"""`handscope desktop-entry`: an icon in the menu of a Linux desktop that opens the pages, logged in.

Source  Desktop Entry Specification 1.5 (freedesktop.org): keys, quoting of Exec; Icon Theme Specification: where the icon lies
"""

import argparse
import os
import re
import shutil
import sys
from importlib.resources import as_file, files
from pathlib import Path

from handscope.app.commands.words import default_data, say
from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe

ENTRY = """[Desktop Entry]
Type=Application
Version=1.5
Name=Handscope
Comment=Measure how a hand moves
Comment[de]=Messen, wie sich eine Hand bewegt
Exec={words}
Icon=handscope
Terminal=true
Categories=MedicalSoftware;Science;
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "--data",
        type=Path,
        default=default_data(),
        metavar="DIR",
        help="data folder that the icon opens (%(default)s)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"),
        metavar="DIR",
        help="folder of the desktop's data, with applications and icons below it (%(default)s)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    entry = arguments.out / "applications" / "handscope.desktop"
    icon = arguments.out / "icons" / "hicolor" / "scalable" / "apps" / "handscope.svg"
    program = Path(sys.executable).with_name("handscope")
    words = [str(program), "open", "--data", str(arguments.data.absolute())]
    try:
        for path in (entry, icon):
            path.parent.mkdir(parents=True, exist_ok=True)
        with as_file(files("handscope.static") / "favicon.svg") as drawing:
            shutil.copyfile(drawing, icon)
        entry.write_text(ENTRY.format(words=" ".join(map(quote, words))), "utf-8")
    except OSError as problem:
        raise InputError(
            "command.desktop_entry", folder=arguments.out, problem=describe(problem)
        ) from None
    say(f"{entry}: opens Handscope on {arguments.data}; close its terminal to stop the server")
    return 0


def quote(word: str) -> str:
    """A word of Exec in double quotes: quote, backtick, dollar and backslash escaped, both for the
    command and for the string that holds it, and a percent sign doubled."""
    escaped = re.sub(r'(["`$\\])', r"\\\1", word).replace("\\", "\\\\")
    return f'"{escaped}"'.replace("%", "%%")
