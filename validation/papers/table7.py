"""Known distance between two points of contact while the whole hand moves near steel: Salchow-Hoemmen 2019, Table 7."""

from collections.abc import Mapping, Sequence
from itertools import product

from handscope.estimators.data.fingertip_contacts import FINGERTIPS, contact_points_of
from handscope.estimators.simulation.experiments import TABLE7
from handscope.validation.papers import published
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.accuracy import distance_rmse
from handscope.validation.reproduce.experiments import (
    VARIANTS,
    Trial,
    chosen,
    estimated,
    in_either_field,
    simulated_setting,
)
from handscope.validation.reproduce.finding import Finding, Row, Table, spread, standing

CM = 100.0
PAPER = "Salchow-Hoemmen 2019, Table 7, average of four subjects"
DISTURBED = {variant: variant for variant in VARIANTS}  # columns and their methods
HOMOGENEOUS = {"m1, homogeneous": "m1", "m2, homogeneous": "m2"}
WHY = (
    "Why the field breaks `m1` and not `m2`: a magnetometer gives the direction of the horizontal field where it is, and takes it for north. In a "
    "homogeneous field all sensors have the same north and it cancels between neighbouring segments. Near steel the field's direction changes over "
    "centimetres: each segment is turned about the vertical by the difference between its own north and its neighbour's, another one wherever the hand "
    "goes, and `m1` in addition by the differences that were there in the initial pose. `m2` has no magnetometer in its equations."
)
Errors = Mapping[str, Mapping[str, float]]  # cm by row and column


def trials(wanted: Wanted) -> Sequence[Trial]:
    """One recording of each experiment and seed; the block's pairs of fingers are judged on one and the same."""
    grasps = dict.fromkeys(_grasp(name) for name in chosen(wanted.experiments, TABLE7))
    first = [next(name for name in TABLE7 if _grasp(name) == grasp) for grasp in grasps]
    return [Trial(name, seed) for name, seed in product(first, range(wanted.seeds))]


def measure(trial: Trial) -> Errors:
    """RMSE of the known distance by row and column."""
    found: dict[str, dict[str, float]] = {
        name: {} for name in TABLE7 if _grasp(name) == _grasp(trial.experiment)
    }
    for recording, columns in zip(in_either_field(trial), (DISTURBED, HOMOGENEOUS)):
        for column, variant in columns.items():
            estimate, _ = estimated(recording, variant)
            for name, errors in found.items():
                a, b = (
                    contact_points_of(estimate, recording.geometry, f, point, FINGERTIPS[f])
                    for f, point in TABLE7[name].contact
                )
                errors[column] = CM * distance_rmse(a, b, TABLE7[name].distance)
    return found


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Errors]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    names = chosen(wanted.experiments, TABLE7)
    rows = _rows(names, results)
    near_steel = Table(
        "RMSE of the known distance, field disturbed by steel, cm",
        tuple(DISTURBED),
        rows,
        "m2",
        "experiment",
    )
    either = Table(
        "The same people in either field, cm",
        ("m1, homogeneous", "m1", "m2, homogeneous", "m2"),
        _without_paper(rows),
        head="experiment",
    )
    setting = (
        f"Beside ours: {PAPER}. `m2 heading` is the paper's variant (alignment=heading), `m2` ours.",
        *simulated_setting(True),
    )
    remarks = (
        f"m2: {standing(near_steel, 'our mean is')}",
        _broken(names, results),
        _worse_than_baseline(rows),
        WHY,
    )
    title = "Whole hand moves near steel (Table 7)"
    return Finding("table7", title, setting, (near_steel, either), remarks=remarks)


def _grasp(name: str) -> str:
    """P1 to P4 of an experiment's name."""
    return name.split()[0]


def _rows(names: Sequence[str], results: Sequence[tuple[Trial, Errors]]) -> tuple[Row, ...]:
    rows = []
    for name in names:
        ours = {
            column: spread(errors[name][column] for _, errors in results if name in errors)
            for column in (*DISTURBED, *HOMOGENEOUS)
        }
        theirs = {
            variant: published.TABLE7[name][method] for variant, (method, _) in VARIANTS.items()
        }
        rows.append(Row(name, ours, theirs))
    return tuple(rows)


def _without_paper(rows: Sequence[Row]) -> tuple[Row, ...]:
    return tuple(Row(row.name, row.ours) for row in rows)


def _broken(names: Sequence[str], results: Sequence[tuple[Trial, Errors]]) -> str:
    """What the disturbance does to m1 and m2, each person against themselves."""
    of = [errors[name] for _, errors in results for name in names if name in errors]
    ratio = spread(e["m1"] / e["m1, homogeneous"] for e in of)
    change = max(abs(e["m2"] - e["m2, homogeneous"]) for e in of)
    m2 = (
        "m2 gives the same figures in either field, to the last bit"
        if change == 0
        else f"the largest change of m2 is {change:.2g} cm"
    )
    return f"The disturbance multiplies the error of m1 by {ratio.mean:.1f} on average (largest {ratio.worst:.1f}); {m2}."


def _worse_than_baseline(rows: Sequence[Row]) -> str:
    ours, theirs = (
        sum(of["m1"] > of["b"] for of in (get(row) for row in rows))
        for get in (_means, lambda row: row.theirs)
    )
    return (
        f"m1 is worse than b in {ours} of {len(rows)} rows, in the paper in {theirs}. The paper's room is not described in numbers; the size of our "
        "disturbance comes from another source (de Vries et al. 2009) and is not fitted to the paper's figures."
    )


def _means(row: Row) -> Mapping[str, float]:
    return {column: s.mean for column, s in row.ours.items()}
