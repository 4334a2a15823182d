"""A trajectory as a table: the columns of the derivative (docs/motion-bids.md) and their description."""

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import ANGLES, FINGERS, JOINTS, SEGMENT, SEGMENTS
from handscope.estimators.numerics.typing import Array
from handscope.sessions.tables_io.number_table import NumberTable

Column = tuple[str, str, str, str, str]  # name, component, type, tracked point, unit


def table_of(moved: Trajectory) -> tuple[list[Column], NumberTable]:
    """Columns and values (n, columns): time, angles of every freedom, tips, orientations, standard deviations, flags."""
    columns: list[Column] = [("time", "n/a", "LATENCY", "n/a", "s")]
    data: list[Array] = [moved.t]
    for j, joint in enumerate(JOINTS):
        for a in joint.dofs:
            columns.append((f"{joint.name}_{ANGLES[a]}", "n/a", "JNTANG", joint.name, "rad"))
            data.append(moved.angles[:, j, a])
    for f, finger in enumerate(FINGERS):
        if len(moved) and np.isfinite(moved.tips[:, f, 0]).any():
            columns += [(f"{finger}_tip_{c}", c, "POS", f"{finger}_tip", "m") for c in "xyz"]
            data += list(moved.tips[:, f].T)
    for segment in measured_segments(moved):
        columns += [(f"{segment}_quat_{c}", f"quat_{c}", "ORNT", segment, "n/a") for c in "wxyz"]
        data += list(moved.q_GS[:, SEGMENT[segment]].T)
    _add_forces(moved, columns, data)
    _add_place(moved, columns, data)
    _add_deviations(moved, columns, data)
    for segment in measured_segments(moved):
        columns.append((f"{segment}_flags", "n/a", "MISC", segment, "n/a"))
        data.append(moved.flags[:, SEGMENT[segment]].astype(float))
    return columns, NumberTable(tuple(data))


def channels_of(columns: list[Column]) -> bytes:
    """The channels.tsv of the columns."""
    return (
        "name\tcomponent\ttype\ttracked_point\tunits\n"
        + "\n".join("\t".join(c) for c in columns)
        + "\n"
    ).encode()


def measured_segments(moved: Trajectory) -> list[str]:
    """Segments with an orientation at any time."""
    return [
        s for k, s in enumerate(SEGMENTS) if len(moved) and np.isfinite(moved.q_GS[:, k, 0]).any()
    ]


def _add_forces(moved: Trajectory, columns: list[Column], data: list[Array]) -> None:
    """Forces of the fingertips that have a sensor, with their standard deviations and flags."""
    if moved.forces is None or moved.forces_sd is None or moved.force_flags is None:
        return
    for f, finger in enumerate(FINGERS):
        if np.isfinite(moved.forces[:, f]).any():
            point = f"{finger}_tip_force"
            columns += [(f"{point}_{c}", c, "MISC", point, "N") for c in "xyz"] + [
                (f"{point}_{c}_sd", c, "MISC", point, "N") for c in "xyz"
            ]
            columns.append((f"{point}_flags", "n/a", "MISC", point, "n/a"))
            data += [
                *moved.forces[:, f].T,
                *moved.forces_sd[:, f].T,
                moved.force_flags[:, f].astype(float),
            ]
            _add_torques(moved, f, columns, data)


def _add_torques(moved: Trajectory, f: int, columns: list[Column], data: list[Array]) -> None:
    """Of a finger whose force sensor has six axes."""
    if (
        moved.torques is None
        or moved.torques_sd is None
        or not np.isfinite(moved.torques[:, f]).any()
    ):
        return
    point, name = f"{FINGERS[f]}_tip_force", f"{FINGERS[f]}_tip_torque"
    columns += [
        (f"{name}_{c}{what}", c, "MISC", point, "N*m") for what in ("", "_sd") for c in "xyz"
    ]
    data += [*moved.torques[:, f].T, *moved.torques_sd[:, f].T]


def _add_place(moved: Trajectory, columns: list[Column], data: list[Array]) -> None:
    """Where the hand is, seen from the trunk, and how the trunk is turned."""
    if (
        moved.place is None
        or moved.place_sd is None
        or moved.place_flags is None
        or moved.q_trunk is None
        or moved.signal is None
    ):
        return
    columns += [(f"hand_place_{c}", c, "POS", "hand", "m") for c in "xyz"] + [
        (f"hand_place_{c}_sd", c, "MISC", "hand", "m") for c in "xyz"
    ]
    columns += [(f"trunk_quat_{c}", f"quat_{c}", "ORNT", "trunk", "n/a") for c in "wxyz"]
    columns += [
        ("hand_place_signal", "n/a", "MISC", "hand", "dB"),
        ("hand_place_flags", "n/a", "MISC", "hand", "n/a"),
    ]
    data += [
        *moved.place.T,
        *moved.place_sd.T,
        *moved.q_trunk.T,
        moved.signal,
        moved.place_flags.astype(float),
    ]


def _add_deviations(moved: Trajectory, columns: list[Column], data: list[Array]) -> None:
    if moved.angles_sd is not None:
        for j, joint in enumerate(JOINTS):
            for a in joint.dofs:
                columns.append((f"{joint.name}_{ANGLES[a]}_sd", "n/a", "MISC", joint.name, "rad"))
                data.append(moved.angles_sd[:, j, a])
    if moved.tips_sd is not None:
        for f, finger in enumerate(FINGERS):
            columns += [(f"{finger}_tip_{c}_sd", c, "MISC", f"{finger}_tip", "m") for c in "xyz"]
            data += list(moved.tips_sd[:, f].T)
