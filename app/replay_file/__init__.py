"""A replay as one file that opens in any browser without a network: the 3-D hand, a time line with its chapters, and how fast.

The hand is viser's page with the scene as it stands (StateSerializer.as_html). viser could record every bone's every turn, too, but that takes 4.3 MB and
126,000 messages a minute; here the movement goes beside it as 16 bits a number, RATE pictures a second, and player.js sends the page its messages.
Nothing in the file says who moved, unless the title does.
"""

import base64
import gzip
import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from handscope.app.language import Language
from handscope.app.protocols import Protocol
from handscope.app.scene import postures, view
from handscope.app.scene.hand_scene import HandScene
from handscope.app.scene.mesh import bones
from handscope.app.scene.viser_page import without_controls
from handscope.estimators.data.samples import Event
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, JOINTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

RATE = 30.0  # pictures a second; the player turns the bones on between two
FULL = 4095  # steps from 0 to 1: 0.03 deg, 0.05 mm; finer would only keep the noise and double the file


@dataclass(frozen=True)
class Chapter:
    """A stretch of the recording that can be jumped to."""

    title: str
    start: float  # s of the recording
    stop: float


def replay_file(
    hand: Hand,
    geometry: HandGeometry,
    movement: Mapping[str, Array],
    chapters: Sequence[Chapter],
    title: str,
    language: Language,
) -> bytes:
    """The page as UTF-8; `movement` holds t (n,), angles (n, joints, 3) and q_GH (n, 4), NaN where not known."""
    t, angles, q_GH = thinned(movement["t"], movement["angles"], movement["q_GH"])
    turns, places = bones.pose(postures.filled(angles), geometry)
    reach = float(np.abs(places).max()) * view.units_per_metre(geometry)
    scene, parts = _scene(hand, geometry, angles)
    payload = {
        "t": np.round(t - t[0], 3).tolist(),
        "full": FULL,
        "reach": reach / FULL,
        "bones": len(bones.BONES),
        "parts": parts,
        "chapters": [
            {"title": c.title, "start": round(c.start - t[0], 2), "stop": round(c.stop - t[0], 2)}
            for c in chapters
        ],
        "words": {
            word: language.say(f"replay.{word}")
            for word in ("play", "pause", "speed", "where", "scene", "impossible")
        },
    }
    turned = quat.multiply(view.heading_removed(q_GH[0], hand), q_GH)
    numbers = [
        turned,
        turns.reshape(len(t), -1),
        places.reshape(len(t), -1) * view.units_per_metre(geometry) / reach,
    ]
    gaps = {
        "language": language.code,
        "title": html.escape(title),
        "notice": html.escape(language.say("replay.notice")),
        "payload": json.dumps(payload, separators=(",", ":")).replace("<", "\\u003c"),
        "movement": packed(np.concatenate(numbers, axis=1)),
        "scene": _base64(scene.encode()),
        "player": files(__package__).joinpath("player.js").read_text("utf-8"),
    }
    page = files(__package__).joinpath("page.html").read_text("utf-8")
    for name, text in gaps.items():
        page = page.replace(f"@{name}@", text)
    return page.encode()


def chapters(
    events: Sequence[Event], protocols: Mapping[str, Protocol], language: Language
) -> list[Chapter]:
    """The initial poses and the tasks of a recording, each trial with its number where there are several."""
    shown = [e for e in events if e.trial_type in ("initial_pose", "task")]
    titles = [_title(e, protocols, language) for e in shown]
    several = [
        f"{title} {titles[: k + 1].count(title)}" if titles.count(title) > 1 else title
        for k, title in enumerate(titles)
    ]
    return [Chapter(title, e.onset, e.end) for title, e in zip(several, shown)]


def _title(event: Event, protocols: Mapping[str, Protocol], language: Language) -> str:
    if event.trial_type == "initial_pose":
        return language.say("replay.initial_pose")
    name = str(event.details.get("task_name", "task"))
    return (
        language.translate(protocols[name].title)
        if name in protocols
        else name.replace("_", " ").capitalize()
    )


def thinned(t: Array, angles: Array, q_GH: Array) -> tuple[Array, Array, Array]:
    """At most RATE samples a second; an orientation that is not known is the one before, at first the one that comes."""
    wanted = np.searchsorted(t, np.arange(t[0], t[-1] + 1e-9, 1.0 / RATE))
    rows = np.unique(np.clip(wanted, 0, len(t) - 1))
    known = np.isfinite(q_GH).all(axis=1)
    if not known.any():
        return t[rows], angles[rows].astype(float), np.tile(quat.IDENTITY, (len(rows), 1))
    last = np.maximum.accumulate(np.where(known, np.arange(len(t)), int(np.argmax(known))))
    return t[rows], angles[rows].astype(float), q_GH[last[rows]].astype(float)


def packed(numbers: Array) -> str:
    """Numbers (n, k) from -1 to 1 as 16 bits, each column's steps one after the other (they wrap round), gzipped, in base64."""
    columns = np.round(np.clip(numbers, -1, 1) * FULL).astype("<i2").T
    steps = np.diff(columns, axis=1, prepend=np.zeros((len(columns), 1), "<i2"))
    return _base64(steps.astype("<i2").tobytes())


def _scene(hand: Hand, geometry: HandGeometry, angles: Array) -> tuple[str, dict[str, list[int]]]:
    """viser's page with the hand in it, and which bones each of its meshes follows."""
    with HandScene(hand, geometry) as scene:
        moving = {joint.child for k, joint in enumerate(JOINTS) if np.isfinite(angles[:, k]).any()}
        scene.measured([f for f in FINGERS if CHAINS[f][-1] in moving])
        return without_controls(scene.as_html()), scene.bones_by_mesh()


def _base64(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()
