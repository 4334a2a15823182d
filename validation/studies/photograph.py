"""How well one photograph of a hand on the sheet, or two, measure it: rendered pictures with known truth, marked as exactly as a person does."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from handscope.app.photograph.pictures import Photograph, measure_hand, open_photograph
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS
from handscope.estimators.numerics.typing import Array
from handscope.estimators.photograph.hand_figures import Figures
from handscope.estimators.photograph.sheet import LANDMARKS, PAPERS
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.finding import Finding, Row, Table, Verdict, spread

if TYPE_CHECKING:
    from handscope.validation.studies.rendered_photographs import Rendered

TILTS = {"to 10 deg": 10.0, "to 25 deg": 25.0}
MARKS = {"exact": 0.0, "0.3 mm": 0.3e-3, "0.5 mm": 0.5e-3}  # m, standard deviation of a mark
PICTURES = {"": 1, ", two pictures": 2}
HIDDEN = 3.0  # times that, of the thumb's CMC joint
LENGTH, ANGLE = 1.0, 0.7  # mm and deg RMS, to be reached
COLUMNS = ("lengths, mm", "angles, deg", "NEES lengths", "NEES angles")


@dataclass(frozen=True)
class Trial:
    """One picture."""

    tilt: str
    seed: int


def trials(wanted: Wanted) -> Sequence[Trial]:
    """As many pictures of each tilt as people."""
    return [Trial(tilt, seed) for tilt in TILTS for seed in range(wanted.seeds)]


def measure(trial: Trial) -> Mapping[str, float]:
    """Mean squared errors by how exactly landmarks were marked; 0 `taken` where the picture was refused."""
    from handscope.validation.studies.rendered_photographs import render_sides

    rng = np.random.default_rng([30, trial.seed, list(TILTS).index(trial.tilt)])
    hand, paper = HANDS[trial.seed % 2], list(PAPERS)[trial.seed // 2 % 2]
    tilts = np.radians(TILTS[trial.tilt]) * rng.uniform(size=2)
    sides = render_sides(rng, hand, paper, list(tilts))
    try:
        photographs = [open_photograph(made.jpeg, hand) for made in sides]
    except InputError:
        return {"taken": 0.0}
    found, scatters = {"taken": 1.0}, rng.normal(size=(2, len(LANDMARKS), 2))
    for name, sd in MARKS.items():
        pictures = [
            (photograph, _marked(made, sd * _pixels_a_metre(photograph) * scatter))
            for photograph, made, scatter in zip(photographs, sides, scatters)
        ]
        for more, count in PICTURES.items():
            values = _errors(measure_hand(pictures[:count]), sides[0])
            found |= {f"{name}{more}: {c}": value for c, value in zip(COLUMNS, values)}
    return found


def _marked(made: "Rendered", offs: Array) -> dict[str, Array]:
    """Landmarks beside where they are seen by `offs` (n, 2), pixels."""
    offs = offs * np.where(np.array(LANDMARKS) == "thumb_cmc", HIDDEN, 1.0)[:, None]
    return {name: made.marks[name] + off for name, off in zip(LANDMARKS, offs)}


def _errors(figures: Figures, made: "Rendered") -> tuple[float, ...]:
    """Mean squares, in the order of COLUMNS."""
    lengths = np.array([v - made.geometry.lengths[k] for k, v in figures.lengths.items()])
    angles = np.array([v - made.deviation[k] for k, v in figures.deviation.items()])
    of_lengths = np.array([*figures.lengths_sd.values()])
    of_angles = np.array([*figures.deviation_sd.values()])
    return (
        float((1e6 * lengths**2).mean()),
        float((np.degrees(angles) ** 2).mean()),
        float(((lengths / of_lengths) ** 2).mean()),
        float(((angles / of_angles) ** 2).mean()),
    )


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Mapping[str, float]]]) -> Finding:
    """One row a tilt and exactness of marks."""
    rows, verdicts = [], []
    for tilt in TILTS:
        taken = [found for trial, found in results if trial.tilt == tilt and found["taken"]]
        for marks in (mark + more for more in PICTURES for mark in MARKS):
            values = [[found[f"{marks}: {c}"] for found in taken] for c in COLUMNS]
            squares = [np.sqrt(v) if k < 2 else v for k, v in enumerate(values)]
            ours = {c: spread(v) for c, v in zip(COLUMNS, squares)}
            rows.append(Row(f"{tilt}, marks {marks}", ours))
            for k, limit in enumerate((LENGTH, ANGLE)):
                what, unit = COLUMNS[k].split(", ")
                value = float(np.sqrt(np.mean(values[k])))
                verdicts.append(
                    Verdict(f"{what}, {tilt}, marks {marks}", value, limit, f"{unit} RMS", "wanted")
                )
    count = sum(not found["taken"] for _, found in results)
    setting = (
        "Rendered photographs of hands on the printed sheet (A4 and Letter, both hands): perspective of a phone, tilt uniform up to what is given, a lens of another "
        "distortion model than the program's, blur, noise, shadow, light from one side; people of other lengths, thickness of fingers (12 %, without a source), tissue at the tips. The "
        "hand lies 4 mm and 3 deg beside the outline, its fingers are spread by 4 deg, its wrist turned by 6 deg. A second picture is taken from about the opposite side, tilted by as much at most, "
        "and marked anew.",
        "Landmarks are marked where they are seen, with the scatter that is given (thumb's CMC joint three times that). NEES: mean normalised error squared.",
    )
    table = Table("Tilt, marks", COLUMNS, tuple(rows), over="pictures")
    remarks = (f"{count} of {len(results)} hands' pictures were refused.",)
    return Finding(
        "photograph",
        "What a photograph of the hand on the sheet tells",
        setting,
        (table,),
        tuple(verdicts),
        remarks,
        simulated=False,
    )


def _pixels_a_metre(photograph: Photograph) -> float:
    camera = photograph.camera
    return float(camera.focal * max(camera.size) / camera.place[2])
