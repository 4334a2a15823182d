"""What a method made of a recording, in a notebook: movement, measures, report, exports."""

from os import PathLike
from pathlib import Path
from typing import Any

from handscope.app.analysis.movement import LengthUnit, Movement
from handscope.app.language import language as language_of
from handscope.app.language import languages
from handscope.app.version import software_version
from handscope.estimators.data.options import changed_options
from handscope.estimators.errors import InputError
from handscope.estimators.measures.accuracy import accuracy_of
from handscope.estimators.measures.assessment import TaskResult, assess
from handscope.estimators.methods import ALL_METHODS
from handscope.estimators.pipeline.process import Processed
from handscope.sessions.files import frames
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.tables_io.writing import save_file

COLUMNS = ("task", "measure", "name", "value", "sd", "unit", "grade", "reason", "meaning", "source")


class Result(Movement):
    """A processed recording. What is not here (`calibrations`, `warnings`, `findings`) is that of `processed`."""

    def __init__(
        self, recording: LoadedRecording, processed: Processed, method: str, params: Any
    ) -> None:
        super().__init__(processed.trajectory)
        self.recording, self.processed, self.method, self.params = (
            recording,
            processed,
            method,
            params,
        )

    def __getattr__(self, name: str) -> Any:
        if name == "processed":  # while it is being copied
            raise AttributeError(name)
        return getattr(self.processed, name)

    def tasks(self) -> list[TaskResult]:
        """Every measure of every task.

        Returns
        -------
        list of TaskResult
            Figures and details in SI units.
        """
        accuracy = accuracy_of(self.method, self.processed.calibrations)
        return assess(self.trajectory, self.recording.events, self.recording.geometry, accuracy)

    def measures(self, task: str | None = None) -> Any:
        """The figures of tasks as a table.

        Parameters
        ----------
        task
            Name of one task; without it all.

        Returns
        -------
        pandas.DataFrame
            A row a figure: value, standard deviation and grade; SI units, named in the row.

        Raises
        ------
        InputError
            For a task that the recording does not have.
        """
        done = self.tasks()
        names = dict.fromkeys(t.task for t in done)
        if task is not None and task not in names:
            raise InputError("analysis.unknown_task", task=task, names=", ".join(names))
        chosen = [t for t in done if task in (None, t.task)]
        return frames.frame(frames.figures(chosen))[list(COLUMNS)]

    def segment_lengths(self, unit: LengthUnit = "mm") -> Any:
        """Lengths that the method used.

        Parameters
        ----------
        unit
            "mm" or "m".

        Returns
        -------
        pandas.DataFrame
            A row a segment: length, and its standard deviation where the method found it.

        Raises
        ------
        InputError
            For another unit.
        """
        if unit not in ("mm", "m"):
            raise InputError("analysis.unknown_length_unit", unit=unit)
        factor, c = (1e3 if unit == "mm" else 1.0), self.processed.calibrations[0]
        lengths = {s: v for s, v in c.geometry.lengths.items() if v > 0}
        sd = [factor * c.lengths_sd[s] if s in c.lengths_sd else float("nan") for s in lengths]
        table = {"segment": list(lengths), "length": [factor * v for v in lengths.values()]}
        return frames.frame({**table, "sd": sd, "unit": unit}).set_index("segment")

    def cite(self) -> str:
        """What to write into a paper.

        Returns
        -------
        str
            Software, version, method, options that were changed, and the method's source.
        """
        module = ALL_METHODS[self.method]
        changed = [f"{name}={value}" for name, value in changed_options(self.params).items()]
        options = f", {', '.join(changed)}" if changed else ""
        source = _paragraph(module.__doc__ or "", "Source")
        return f"Handscope {software_version()}, method {self.method}{options}: {module.TITLE}. {source}".strip()

    def report(self, path: str | PathLike[str], language: str = "en", patient: str = "") -> None:
        """Write the report.

        Parameters
        ----------
        path
            Ends in .pdf or .html.
        language
            en, de, ...
        patient
            A pseudonym, never a name.

        Raises
        ------
        InputError
            For another ending, an unknown language, and where the file cannot be written.
        """
        from handscope.app.protocols import load_all
        from handscope.app.report import FORMS, Style
        from handscope.app.report.content import Visit, content

        target = Path(path)
        if target.suffix not in (".pdf", ".html"):
            raise InputError("analysis.report_suffix", target=str(target))
        if language not in languages():
            raise InputError(
                "analysis.unknown_language", code=language, codes=", ".join(languages())
            )
        made = content(
            Visit(patient=patient),
            self.recording,
            self.processed,
            self.method,
            self.params,
            self.tasks(),
            software_version(),
            load_all(),
        )
        save_file(FORMS[target.suffix[1:]](made, Style(language_of(language))), target)

    def export(self, name: str, path: str | PathLike[str], pseudonym: str = "") -> list[str]:
        """Write files for other programs.

        Parameters
        ----------
        name
            A format of docs/exports.md.
        path
            Of the file, or of the folder where the format has several files.
        pseudonym
            A code of the patient, never a name.

        Returns
        -------
        list of str
            What is to be known about the files, such as joints that they lack.

        Raises
        ------
        InputError
            For an unknown format, and where the files cannot be written.
        """
        from handscope.app.exporting.measured import export_processed, gather
        from handscope.app.exporting.saving import require_place, save
        from handscope.sessions.exports import format_of

        require_place(Path(path), format_of(name))
        measured = gather(self.recording, self.processed, self.method, self.params, pseudonym)
        made = export_processed(measured, name, self.processed, self.params)
        save(made.files, Path(path))
        return list(made.notices)


def _paragraph(text: str, heading: str) -> str:
    """The paragraph of a module's docstring that begins with a heading, on one line."""
    lines, inside = [], False
    for line in text.splitlines():
        inside = line.startswith(heading) or (inside and line.startswith(" "))
        if inside:
            lines.append(line.removeprefix(heading).strip())
    return " ".join(lines)
