"""Biovision hierarchy: a skeleton and its joint rotations, for Blender and other animation programs; metres, y up.

Source  Meredith & Maddock 2001, "Motion capture file formats explained", University of Sheffield CS-01-11
"""

from collections.abc import Iterator

import numpy as np

from handscope.app.exports.skeleton import (
    UPRIGHT,
    Bone,
    bones,
    known_angles,
    root_orientation,
    tip_offsets,
)
from handscope.app.results.export_content import Content
from handscope.estimators.hand import joint_angles
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

ROTATIONS = "Zrotation Xrotation Yrotation"  # intrinsic z, x', y'': flexion, deviation, pronation


def write(content: Content) -> bytes:
    """The file. The root is the forearm, at rest in the wrist's centre."""
    tree = bones(content.geometry)
    lines = ["HIERARCHY", "ROOT forearm", "{", *_indented(_root(content, tree)), "}"]
    return ("\n".join([*lines, *_motion(content, tree)]) + "\n").encode()


def _root(content: Content, tree: list[Bone]) -> Iterator[str]:
    yield "OFFSET 0 0 0"
    yield f"CHANNELS 6 Xposition Yposition Zposition {ROTATIONS}"
    yield from _children("forearm", content, tree)


def _children(parent: str, content: Content, tree: list[Bone]) -> Iterator[str]:
    tips = dict(tip_offsets(content.geometry).values())
    for bone in (b for b in tree if b.parent == parent):
        yield f"JOINT {bone.name}"
        yield "{"
        yield f"  OFFSET {_numbers(bone.offset)}"
        yield f"  CHANNELS 3 {ROTATIONS}"
        yield from _indented(_children(bone.name, content, tree))
        if bone.name in tips:
            yield from ("  End Site", "  {", f"    OFFSET {_numbers(tips[bone.name])}", "  }")
        yield "}"


def _motion(content: Content, tree: list[Bone]) -> Iterator[str]:
    t, angles = content.moved.t, known_angles(content)
    root = joint_angles.decompose(quat.multiply(UPRIGHT, root_orientation(content.moved, angles)))
    order = [bone.joint for bone in _depth_first("forearm", tree)]
    values = np.degrees(np.concatenate([root[:, None], angles[:, order]], axis=1))
    yield "MOTION"
    yield f"Frames: {len(t)}"
    yield f"Frame Time: {(t[-1] - t[0]) / max(len(t) - 1, 1):.9f}"
    for row in values.reshape(len(t), -1):
        yield "0 0 0 " + _numbers(row)


def _depth_first(parent: str, tree: list[Bone]) -> Iterator[Bone]:
    for bone in (b for b in tree if b.parent == parent):
        yield bone
        yield from _depth_first(bone.name, tree)


def _indented(lines: Iterator[str]) -> Iterator[str]:
    return (f"  {line}" for line in lines)


def _numbers(values: Array) -> str:
    return " ".join(f"{v:.9g}" for v in values)
