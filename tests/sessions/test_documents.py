"""The pages say what the code does: types, codes, names, units, numbers."""

import re
from pathlib import Path

import pytest

from handscope.estimators.data.samples import TRACKED_POINTS, TRUNK_MAGNETOMETERS
from handscope.estimators.data.trajectory import Flag, ForceFlag, PlaceFlag
from handscope.estimators.hand.anatomy import ANGLES, JOINTS, SEGMENTS
from handscope.estimators.hand.geometry import (
    FINGER_LENGTH,
    MCP_DISTAL,
    MCP_ULNAR,
    RATIO_CI95,
    RATIOS,
    TIP_TISSUE,
    TIP_TISSUE_SD,
)
from handscope.sessions.files.recorder import CHANNELS, FORMAT_VERSION
from handscope.sessions.motion_bids import files
from handscope.sessions.motion_bids.reader import TORQUES, UNITS
from handscope.sessions.wire import framing, messages
from handscope.sessions.wire.assembly import WAITING
from handscope.sessions.wire.messages import Ping, ReplyCode

DOCS = Path(__file__).parents[2] / "docs"
PAGES = {
    name: (DOCS / f"{name}.md").read_text()
    for name in ("wire-protocol", "recording", "motion-bids", "conventions")
}
WIRE, RECORDING, BIDS, CONVENTIONS = PAGES.values()


def _rows(page: str) -> list[list[str]]:
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in page.splitlines()
        if line.startswith("|")
    ]


def test_every_message_stands_under_its_type() -> None:
    told = {
        row[1].strip("`"): int(row[0], 16)
        for row in _rows(WIRE)
        if re.fullmatch("[0-9a-f]{2}", row[0])
    }
    assert told == {kind.__name__: code for kind, (code, _, _) in messages._CODECS.items()}


def test_the_example_frame_is_right() -> None:
    frame = bytes.fromhex(next(m for m in re.findall("`([0-9a-f ]{20,})`", WIRE)))
    assert framing.Encoder().frame(Ping(7)) == frame


def test_numbers_of_the_wire_are_those_of_the_code() -> None:
    assert f"At most {framing.LONGEST} bytes" in WIRE
    assert f"up to {framing.REORDER} behind" in WIRE
    assert f"up to {WAITING} bursts" in WIRE
    assert f"Version {messages.VERSION}." in WIRE
    assert "(0 done, 1 unknown command, 2 bad argument, 3 busy)" in WIRE
    assert [c.value for c in ReplyCode] == [0, 1, 2, 3]
    for k, quantity in enumerate(messages.QUANTITIES):
        assert re.search(rf"\b{2**k} {quantity} \(", WIRE)
    for k, point in enumerate(TRACKED_POINTS):
        assert (
            re.search(rf"\b{k} {point}\b", WIRE)
            or point.split("_")[0] in ("middle", "ring", "little")
            or point in TRUNK_MAGNETOMETERS[1:-1]
        )


def test_the_recordings_page_names_every_channel() -> None:
    told = {row[0]: row[1] for row in _rows(RECORDING) if re.fullmatch(r"`\w+` \(\d\)", row[0])}
    assert told == {
        f"`{topic}` ({c.id})": f"`{c.message_encoding}`" for topic, c in CHANNELS.items()
    }
    assert f"Format version {FORMAT_VERSION}." in RECORDING


def test_every_unit_stands_beside_its_type() -> None:
    told = {
        row[0].strip("`"): set(re.findall("`([^`]+)`", row[2]))
        for row in _rows(BIDS)
        if row[0].strip("`") in UNITS
    }
    for kind, units in UNITS.items():
        read = {*units, *(TORQUES if kind == "MISC" else ())}
        assert told[kind] == {u.replace("\u03bc", "\u00b5") for u in read}, kind


def test_limits_of_a_zip_and_flags_are_told() -> None:
    assert (
        f"{files.MOST_FILES:,}".replace(",", " ") + f" files or {files.MOST_BYTES // 2**30} GB"
        in BIDS
    )
    assert f"{files.MOST_RATIO} times its size" in BIDS
    for column, flags in (
        ("<segment>_flags", Flag),
        ("<finger>_tip_force_flags", ForceFlag),
        ("hand_place_flags", PlaceFlag),
    ):
        (row,) = (line for line in BIDS.splitlines() if line.startswith(f"| `{column}`"))
        assert [int(n) for n in re.findall(r"(\d+) [a-z]+ ", row)] == [flag.value for flag in flags]


@pytest.mark.parametrize("joint", JOINTS, ids=lambda joint: joint.name)
def test_every_joint_has_its_freedoms_and_ranges(joint: object) -> None:
    told = {
        row[0].split("`")[1]: row[1]
        for row in _rows(CONVENTIONS)
        if row[0].startswith("`") and ".." in row[1]
    }
    like = joint.name if joint.name in told else f"index_{joint.name.split('_')[1]}"
    assert told[like] == ", ".join(
        f"{ANGLES[a]} {low}..{high}" for a, (low, high) in joint.limits.items()
    )


def test_the_hands_proportions_are_those_of_the_code() -> None:
    rows = {row[0].split(",")[0]: row[1:] for row in _rows(CONVENTIONS)}
    fingers = ("thumb", "index", "middle", "ring", "little")
    assert rows["proximal : middle (thumb: proximal : distal)"] == [
        f"{RATIOS[f][0]:.2f}" for f in fingers
    ]
    assert rows["middle : distal"] == ["", *(f"{RATIOS[f][1]:.2f}" for f in fingers[1:])]
    assert rows["95 % CI"] == [
        "",
        *(", ".join(f"{ci:.3f}" for ci in RATIO_CI95[f]) for f in fingers[1:]),
    ]
    assert rows["tissue at the tip"] == [
        f"{1e3 * TIP_TISSUE[f]:.2f}, {1e3 * TIP_TISSUE_SD[f]:.2f}" for f in fingers
    ]
    assert rows["finger"] == [f"{FINGER_LENGTH[f]:.3f}" for f in fingers]
    assert rows["MCP from the wrist distally"] == [
        "",
        *(f"{MCP_DISTAL[f]:.3f}" for f in fingers[1:]),
    ]
    assert rows["MCP ulnarly"] == ["", *(f"{MCP_ULNAR[f]:.3g}" for f in fingers[1:])]


def test_the_pages_name_segments_and_files_that_exist() -> None:
    for segment in SEGMENTS[:8]:
        assert f"`{segment}`" in CONVENTIONS
        assert f"`{segment}`" in BIDS
    for page in PAGES.values():
        for link in re.findall(r"\]\((?!http)([^)#]+)\)", page):
            assert (DOCS / link).exists(), link
        for path in re.findall(r"`((?:estimators|sessions|app)/[\w/.]+)`", page):
            assert (DOCS.parent / path).exists(), path
