"""Makers' own files, laid out as their makers document them: what is guessed, and the values."""

from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, MAG, ORIENTATION
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS
from handscope.estimators.numerics import quaternions as quat
from handscope.sessions.table_import.convert import blocks_of
from handscope.sessions.table_import.formats.bvh import Z_UP
from handscope.sessions.table_import.guess import guess_map
from handscope.sessions.table_import.tables import read_table

ROWS = 40
G = 9.80665
TIMES = np.arange(ROWS) / 60.0


def _blocks(path: Path) -> dict[str, np.ndarray]:
    """Values by stream, as the guessed map gives them."""
    columns, _ = guess_map(path)
    return {b.stream.name: b.values for b in blocks_of(read_table(path, columns.table), columns)}


def test_xsens_dot_has_units_that_its_header_does_not_say(tmp_path: Path) -> None:
    path = tmp_path / "left_index_middle_D422CD00.csv"
    names = "PacketCounter,SampleTimeFine,Quat_W,Quat_X,Quat_Y,Quat_Z,FreeAcc_X,FreeAcc_Y,FreeAcc_Z,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z"
    rows = [f"{k},{4_000_000 + k * 16667},1,0,0,0,0,0,0,0,0,{G},30,0,0" for k in range(ROWS)]
    head = ["sep=,", "DeviceTag: index", "FirmwareVersion: 1.6.0", "OutputRate: 60Hz", ""]
    path.write_text("\n".join([*head, names, *rows]) + "\n")
    columns, questions = guess_map(path)
    assert (columns.hand, columns.time, questions) == ("left", ("SampleTimeFine", "us"), [])
    assert list(columns.sensors) == ["index_middle"]
    channels = columns.sensors["index_middle"].channels
    assert (channels[GYR].unit, channels[ACC].columns[0]) == ("deg/s", "Acc_X")
    blocks = _blocks(path)
    np.testing.assert_allclose(blocks["index"][0, 0], [np.pi / 6, 0, 0, 0, 0, G])
    np.testing.assert_array_equal(blocks["index_orientation"][0, 0], [1, 0, 0, 0])


def test_shimmer_has_units_below_the_names(tmp_path: Path) -> None:
    path = tmp_path / "right_hand.csv"
    signals = ("Timestamp_Unix_CAL", *(f"{s}_{c}_CAL" for s in ("Accel_LN", "Gyro") for c in "XYZ"))
    names = "\t".join(f"Shimmer_B83B_{s}" for s in signals)
    units = "\t".join(["ms", *["m/(s^2)"] * 3, *["deg/s"] * 3])
    rows = [f"{1.7e12 + k * 1000 / 60:.3f}\t0\t0\t{G}\t45\t0\t0" for k in range(ROWS)]
    path.write_text("\n".join(['"sep=\t"', names, units, *rows]) + "\n")
    columns, questions = guess_map(path)
    assert (columns.hand, questions) == ("right", [])
    assert columns.time == ("Shimmer_B83B_Timestamp_Unix_CAL", "ms")
    np.testing.assert_allclose(_blocks(path)["hand"][0, 0], [np.pi / 4, 0, 0, 0, 0, G])


@pytest.mark.parametrize(
    ("delimiter", "decimal", "name"),
    [
        (",", ".", "Noraxon MyoMotion-Segments-{segment} LT-{signal}-{axis} ({unit})"),
        (";", ",", "LT {segment} {short} Sensor {axis} ({unit})"),
    ],
)
def test_myomotion_has_sides_and_units_of_its_own(
    tmp_path: Path, delimiter: str, decimal: str, name: str
) -> None:
    """As public programs read it: lines above the header, columns of words, both hands."""
    signals = (("Acceleration", "Accel", "mG"), ("Gyroscope", "Gyro", "deg/s"))
    columns = [
        name.format(segment=segment, signal=signal, short=short, axis=axis, unit=unit)
        for segment in ("Hand", "Forearm")
        for signal, short, unit in signals
        for axis in ("xyz" if "Segments" in name else "XYZ")
    ]
    others = [c.replace("LT", "RT") for c in columns]
    reading = (0.5, 0, 1000.5, 30, 0, 0)
    rows = [
        [f"{k / 200:.4f}", "walk", "", *(f"{v:g}".replace(".", decimal) for v in reading * 4)]
        for k in range(ROWS)
    ]
    for row in rows:
        row[0] = row[0].replace(".", decimal)
    lines = [delimiter.join(r) for r in (["time", "Activity", "Marker", *others, *columns], *rows)]
    path = tmp_path / "export.csv"
    path.write_text("\n".join(["Recording", "1.1.2026", "", *lines]) + "\n")
    found, questions = guess_map(path)
    assert found.time == ("time", "s")
    assert len(questions) == 1 and "both hands" in questions[0]
    assert found.hand == "left"
    assert found.sensors["hand"].channels[ACC].columns == tuple(columns[:3])
    blocks = _blocks(path)
    assert set(blocks) == {"hand", "forearm"}
    np.testing.assert_allclose(
        blocks["hand"][0, 0], [np.pi / 6, 0, 0, 0.5e-3 * G, 0, 1.0005 * G], rtol=1e-5
    )


def _mvnx(path: Path, fingers: bool) -> dict[str, np.ndarray]:
    """A file with three segments, the right hand's fingers too; orientations by segment."""
    rng = np.random.default_rng(4)
    labels = ("Pelvis", "RightForeArm", "RightHand")
    body = quat.exp(rng.normal(size=(ROWS, 3, 3)) * 0.3)
    parts = quat.exp(rng.normal(size=(ROWS, 20, 3)) * 0.3)
    frames = ['<frame time="0" index="" type="identity"><orientation/></frame>']
    for k in range(ROWS):
        numbers = [" ".join(map(repr, map(float, q[k].ravel()))) for q in (body, parts)]
        extra = f"<orientationFingersRight>{numbers[1]}</orientationFingersRight>"
        frames.append(
            f'<frame time="{k * 1000 / 60:.6f}" index="{k}" type="normal">'
            f"<orientation>{numbers[0]}</orientation>{extra * fingers}</frame>"
        )
    segments = "".join(f'<segment label="{s}" id="{k}"/>' for k, s in enumerate(labels))
    path.write_text(
        '<?xml version="1.0"?><mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">'
        f'<subject label="s" frameRate="60"><segments>{segments}</segments>'
        f"<frames>{''.join(frames)}</frames></subject></mvnx>"
    )
    found = {"forearm": body[:, 1], "hand": body[:, 2]}
    order = [1, 2, 3, *(4 + 4 * f + j for f in range(4) for j in (1, 2, 3))]
    chain = [s for finger in FINGERS for s in CHAINS[finger]]
    return found | ({s: parts[:, k] for s, k in zip(chain, order)} if fingers else {})


@pytest.mark.parametrize("fingers", [False, True])
def test_mvnx_gives_orientations_of_hand_and_fingers(tmp_path: Path, fingers: bool) -> None:
    expected = _mvnx(tmp_path / "a.mvnx", fingers)
    columns, questions = guess_map(tmp_path / "a.mvnx")
    assert (columns.hand, columns.time, questions) == ("right", ("time [ms]", "ms"), [])
    assert columns.sensors.keys() == expected.keys()
    table = read_table(tmp_path / "a.mvnx", columns.table)
    for point, q in expected.items():
        names = columns.sensors[point].channels[ORIENTATION].columns
        np.testing.assert_array_equal(np.column_stack([table.column(n) for n in names]), q)


def test_bvh_angles_become_orientations_with_z_up(tmp_path: Path) -> None:
    path = tmp_path / "take.bvh"
    order = "CHANNELS 3 Yrotation Xrotation Zrotation"
    offset = "OFFSET 0 1 0"
    path.write_text(
        f"""HIERARCHY
ROOT Hips
{{
{offset}
CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation
JOINT RightHand
{{
{offset}
{order}
JOINT RightHandIndex1
{{
{offset}
{order}
End Site
{{
{offset}
}}
}}
JOINT RightHandThumb1
{{
{offset}
{order}
}}
}}
}}
MOTION
Frames: {ROWS}
Frame Time: {1 / 60:.6f}
"""
        + "0 0 0 90 0 0 0 20 0 0 0 30 0 0 0\n" * ROWS
    )
    blocks = _blocks(path)
    q_hand = quat.multiply(quat.multiply(Z_UP, quat.about(1, np.pi / 2)), quat.about(0, np.pi / 9))
    q_index = quat.multiply(q_hand, quat.about(2, np.pi / 6))
    np.testing.assert_allclose(blocks["hand_orientation"][5, 0], q_hand, atol=1e-12)
    np.testing.assert_allclose(blocks["index_orientation"][5, 0], q_index, atol=1e-12)
    np.testing.assert_allclose(blocks["thumb_orientation"][5, 0], q_hand, atol=1e-12)
    up = quat.rotate(Z_UP, np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(up, [0, 0, 1], atol=1e-12)


def test_apdm_sensors_are_placed_by_their_labels(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "o.h5", "w") as file:
        for number, label in ((101, "Right Hand"), (102, "Right Forearm")):
            sensor = file.create_group(f"Sensors/{number}")
            sensor.create_group("Configuration").attrs["Label 0"] = label
            sensor["Time"] = (1e15 + TIMES * 1e6).astype(np.uint64)
            sensor["Accelerometer"] = np.tile([0, 0, G], (ROWS, 1))
            sensor["Gyroscope"] = np.tile([0.1, 0, 0], (ROWS, 1))
            sensor["Magnetometer"] = np.tile([20.0, 0, 40], (ROWS, 1))
            file[f"Processed/{number}/Orientation"] = np.tile([1.0, 0, 0, 0], (ROWS, 1))
    columns, questions = guess_map(tmp_path / "o.h5")
    assert (columns.hand, columns.time, questions) == ("right", ("time [us]", "us"), [])
    assert list(columns.sensors) == ["hand", "forearm"]
    hand = columns.sensors["hand"].channels
    units = {GYR: "rad/s", ACC: "m/s^2", MAG: "uT", ORIENTATION: "1"}
    assert {q: c.unit for q, c in hand.items()} == units
    expected = [0.1, 0, 0, 0, 0, G, 2e-5, 0, 4e-5]
    np.testing.assert_allclose(_blocks(tmp_path / "o.h5")["forearm"][3, 0], expected)


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("a.mvnx", "<mvnx>", "cannot be read as mvnx"),
        ("a.mvnx", "<mvnx/>", "no segments"),
        ("a.bvh", "HIERARCHY\n}", "a bracket closes nothing"),
        ("a.bvh", "HIERARCHY\nMOTION\nFrame Time: 0.01\n1 2", "numbers wanted: 0"),
        ("a.bvh", "HIERARCHY\nMOTION\nFrame Time: x", "no line of a movement"),
        ("a.h5", "no hdf", "cannot be read as APDM's HDF5|need h5py"),
        ("a.xdf", "no xdf", "cannot be read as XDF|need pyxdf"),
    ],
)
def test_what_is_no_such_file_is_refused_in_words(
    tmp_path: Path, name: str, text: str, why: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=why):
        guess_map(tmp_path / name)
