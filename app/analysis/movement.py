"""A movement as tables: what a scientist plots, compares and keeps."""

from typing import Any, Literal

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import ANGLES, FINGERS, JOINTS
from handscope.estimators.numerics.typing import Array
from handscope.sessions.files import frames

AngleUnit = Literal["deg", "rad"]
LengthUnit = Literal["mm", "m"]
SCALES = {"deg": 180 / np.pi, "rad": 1.0, "mm": 1e3, "m": 1.0}


class Movement:
    """How a hand moved. Tables have the time in s as their index and a column a freedom or a tip's axis."""

    def __init__(self, trajectory: Trajectory) -> None:
        self.trajectory = trajectory  # SI, as every estimator gives it

    def angles(self, unit: AngleUnit = "deg") -> Any:
        """Joint angles of every freedom that was measured.

        Parameters
        ----------
        unit
            "deg" or "rad".

        Returns
        -------
        pandas.DataFrame
            Indexed by the time in s; a column a freedom, such as `index_pip_flexion` (docs/conventions.md).

        Raises
        ------
        InputError
            For another unit.
        """
        return _angle_table(self.trajectory, self.trajectory.angles, _scale(unit, "deg", "rad"))

    def angles_sd(self, unit: AngleUnit = "deg") -> Any:
        """Standard deviations of the angles.

        Parameters
        ----------
        unit
            "deg" or "rad".

        Returns
        -------
        pandas.DataFrame
            Indexed and named as `angles`.

        Raises
        ------
        InputError
            Where the method gives none (`ekf` does), and for another unit.
        """
        if self.trajectory.angles_sd is None:
            raise InputError("analysis.no_standard_deviations")
        return _angle_table(self.trajectory, self.trajectory.angles_sd, _scale(unit, "deg", "rad"))

    def tips(self, unit: LengthUnit = "mm") -> Any:
        """Places of the fingertips.

        Parameters
        ----------
        unit
            "mm" or "m".

        Returns
        -------
        pandas.DataFrame
            Indexed by the time in s; `index_tip_x` and the like, in the wrist frame (docs/conventions.md).

        Raises
        ------
        InputError
            For another unit.
        """
        scale, moved = _scale(unit, "mm", "m"), self.trajectory
        columns = {
            f"{finger}_tip_{axis}": scale * moved.tips[:, f, k]
            for f, finger in enumerate(FINGERS)
            for k, axis in enumerate("xyz")
            if np.isfinite(moved.tips[:, f]).any()
        }
        return _time_indexed_frame(moved, columns)

    def to_pandas(self) -> Any:
        """Everything in one table.

        Returns
        -------
        pandas.DataFrame
            A row a sample, the units in the columns' names: `index_pip_flexion_deg`, `index_tip_x_mm`.
        """
        return frames.frame(frames.movement(self.trajectory))


def _angle_table(moved: Trajectory, values: Array, scale: float) -> Any:
    columns = {
        f"{joint.name}_{ANGLES[a]}": scale * values[:, j, a]
        for j, joint in enumerate(JOINTS)
        for a in joint.dofs
        if np.isfinite(moved.angles[:, j, a]).any()
    }
    return _time_indexed_frame(moved, columns)


def _time_indexed_frame(moved: Trajectory, columns: dict[str, Array]) -> Any:
    return frames.frame({"time": moved.t, **columns}).set_index("time")


def _scale(unit: str, *units: str) -> float:
    if unit not in units:
        raise InputError("analysis.unknown_output_unit", unit=unit, units=", ".join(units))
    return SCALES[unit]
