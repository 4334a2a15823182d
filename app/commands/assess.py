"""`handscope assess`: the measures of a recording as JSON and CSV, and a report."""

import argparse
from pathlib import Path

from handscope.app.commands.method_arguments import add_method, add_recording
from handscope.app.commands.methods import exit_code, run_method
from handscope.app.commands.words import counted, output_folder, require_file, require_folder, say
from handscope.app.language import DEFAULT, language, languages
from handscope.app.protocols import load_all
from handscope.app.report import FORMS, PAPERS, Style
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.estimators.measures.accuracy import accuracy_of
from handscope.estimators.measures.assessment import assess
from handscope.sessions.tables_io.writing import save_file, save_folder

REPORTS = (".pdf", ".html")


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_recording(parser)
    add_method(parser)
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder for figures.json and figures.csv",
    )
    parser.add_argument(
        "--report", type=Path, metavar="FILE.pdf", help="write the report there (.pdf or .html)"
    )
    parser.add_argument(
        "--language", choices=[*languages()], default=DEFAULT, help=f"of the report ({DEFAULT})"
    )
    parser.add_argument("--paper", choices=PAPERS, default="a4", help="of the report (a4)")
    parser.add_argument(
        "--patient", default="", metavar="PSEUDONYM", help="printed on the report; never a name"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    from handscope.app.report.content import Visit, content

    if arguments.report and arguments.report.suffix not in REPORTS:
        raise InputError(
            "command.report_suffix", report=arguments.report, reports=" or ".join(REPORTS)
        )
    require_folder(arguments.out)
    if arguments.report:
        require_file(arguments.report, arguments.out)
    done = run_method(arguments)
    recording, processed = done.recording, done.processed
    accuracy = accuracy_of(done.method, processed.calibrations)
    tasks = assess(processed.trajectory, recording.events, recording.geometry, accuracy)
    visit = Visit(patient=arguments.patient or "")
    style = Style(language(arguments.language), arguments.paper)
    made = content(
        visit, recording, processed, done.method, done.params, tasks, software_version(), load_all()
    )
    figures = {"figures.json": FORMS["json"](made, style), "figures.csv": FORMS["csv"](made, style)}
    report = FORMS[arguments.report.suffix[1:]](made, style) if arguments.report else b""
    save_folder(figures, output_folder(arguments.out))
    if arguments.report:
        save_file(report, arguments.report)
    for warning in processed.warnings:
        say(f"warning: {warning}")
    say(
        f"{counted(sum(len(t.figures) for t in tasks), 'figure')} of {counted(len(tasks), 'measure')}: {arguments.out}"
    )
    return exit_code("assess", processed, arguments.out)
