"""One finger worn alone, by a simulator that shares nothing with the package's own: errors in standard deviations, with the skin under the hand's
sensor left out and among the unknowns (0005-self-calibration-solves-for-orientations.md has the table).

python docs/decisions/0005-one-finger.py 200 210
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from unittest import mock

import numpy as np
from scipy.spatial.transform import Rotation

from handscope.estimators.data.samples import ACC, GYR, Block, Event, Stream
from handscope.estimators.hand.anatomy import CHAINS, FINGERS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import map as method
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.problem import parameter_columns
from handscope.sessions.files.recording import LoadedRecording

DURATION, RATE, STEP = (
    20.0,
    100.0,
    1e-3,
)  # s, Hz; s between the places of which differences are taken
TURN, SLIDE = (
    np.radians(2.0) / (np.pi / 2),
    1e-3 / (np.pi / 2),
)  # rad and m a rad, of the skin with its joint
GYR_NOISE, ACC_NOISE = np.radians(0.01) * np.sqrt(RATE / 2), 300e-6 * GRAVITY * np.sqrt(RATE / 2)
FOLLOWS = (
    "own",
    "middle",
    "mean",
    "none",
)  # which first joint the skin of the hand's back moves with
COURSES = ("sines", "pulls", "edges")
COUPLED = (0.0, 0.5, 0.8)  # share of what fingers do together
LEVEL = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
Course = Callable[[Array], Array]  # of an angle or a place over the time


@dataclass(frozen=True)
class Truth:
    lengths: Mapping[str, float]  # m
    q_BS: Mapping[str, Array]
    arms: Mapping[
        tuple[str, str], Array
    ]  # m, the joint before a segment, from the sensor before it ("far") and its own ("near")
    biases: Mapping[str, Array]  # rad/s


def course(
    rng: np.random.Generator, middle: float, reach: float, slowest: float, fastest: float, kind: str
) -> Course:
    """About `middle` by `reach`, with frequencies (Hz) in between."""
    f, phase, size = (
        rng.uniform(slowest, fastest, 4),
        rng.uniform(0, 2 * np.pi, 4),
        rng.uniform(0.3, 1.0, 4),
    )
    size, base, slow, late = (
        size / np.linalg.norm(size),
        rng.uniform(slowest, fastest),
        rng.uniform(0.03, 0.1),
        rng.uniform(0, 2 * np.pi),
    )

    def sines(t: Array) -> Array:
        return np.tanh(1.1 * (size * np.sin(2 * np.pi * f * t[:, None] + phase)).sum(axis=1))

    def pulls(t: Array) -> Array:
        swell = 0.75 + 0.25 * np.sin(2 * np.pi * 0.3 * f[1] * t + phase[1])
        return swell * np.sin(
            2 * np.pi * base * t + 1.5 * np.sin(2 * np.pi * slow * t + late) + phase[0]
        )

    def edges(t: Array) -> Array:
        return np.tanh(
            2.0 * np.sin(2 * np.pi * base * t + phase[0])
            + 0.7 * np.sin(2 * np.pi * 0.4 * f[2] * t + phase[2])
        )

    shape = {"sines": sines, "pulls": pulls, "edges": edges}[kind]
    return lambda t: middle + reach * shape(t)


def about(axis: int, angle: Array) -> Array:
    """Rotations (n, 3, 3)."""
    return Rotation.from_rotvec(angle[:, None] * np.eye(3)[axis]).as_matrix()


def somewhere(rng: np.random.Generator) -> Array:
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def person(seed: int, skin: float) -> tuple[LoadedRecording, Truth, str]:
    """Hand and one finger; what is true; the finger."""
    rng, hand, finger = (
        np.random.default_rng([77, seed]),
        sized("left"),
        FINGERS[seed % len(FINGERS)],
    )
    links, kind, coupled = ("hand", *CHAINS[finger]), COURSES[seed % 3], COUPLED[seed // 4 % 3]
    follows = FOLLOWS[seed % 4] if skin else "none"
    size = rng.uniform(0.92, 1.08)
    lengths = {s: hand.lengths[s] * size * rng.uniform(0.92, 1.08) for s in CHAINS[finger]}
    root = np.array(
        hand.joint_positions["thumb_cmc" if finger == "thumb" else f"{finger}_mcp"]
    ) * rng.uniform(0.93, 1.07, 3)
    turns = [course(rng, 0, np.radians(rng.uniform(25, 45)), 0.15, 0.6, "sines") for _ in range(3)]
    moves = [course(rng, 0, rng.uniform(0.05, 0.12), 0.15, 0.6, "sines") for _ in range(3)]
    shared = course(rng, np.radians(35), np.radians(28), 0.4, 1.0, kind)
    firsts = {
        f: course(
            rng, np.radians(rng.uniform(33, 42)), np.radians(rng.uniform(24, 34)), 0.4, 1.0, kind
        )
        for f in FINGERS
    }
    others = [
        course(
            rng, np.radians(rng.uniform(33, 42)), np.radians(rng.uniform(24, 34)), 0.4, 1.0, kind
        )
        for _ in range(2)
    ]
    deviates = course(rng, 0, np.radians(rng.uniform(4, 10)), 0.3, 0.8, "sines")
    pronates = course(rng, 0, np.radians(25.0 if finger == "thumb" else 0.0), 0.3, 0.8, "sines")
    seats = {
        s: Rotation.from_rotvec(np.radians(rng.uniform(0, 9)) * somewhere(rng)) for s in links
    }  # q_BS
    places = {
        s: np.array(
            [rng.uniform(0.006, 0.011), -rng.uniform(0.3, 0.7) * lengths[s], 0.0015 * rng.normal()]
        )
        for s in CHAINS[finger]
    }
    on_back = np.array(
        [
            rng.uniform(0.01, 0.02),
            -rng.uniform(0.3, 0.7) * hand.palm_length,
            rng.uniform(-0.01, 0.01),
        ]
    )
    places["hand"] = np.array(hand.joint_positions["middle_mcp"]) + on_back
    turned, slid = ({s: size * skin * somewhere(rng) for s in links} for size in (TURN, SLIDE))

    def first(name: str, t: Array) -> Array:
        return (1 - coupled) * firsts[name](t) + coupled * shared(t)

    def sensors(t: Array) -> tuple[Array, Array]:
        """Rotations (n, S, 3, 3) and places (n, S, 3) in the world."""
        flexed = [first(finger, t), *(bends(t) for bends in others)]
        back = {"own": [finger], "middle": ["middle"], "mean": FINGERS[1:], "none": []}[follows]
        bent = [
            np.mean([first(name, t) for name in back], axis=0) if back else np.zeros_like(t),
            *flexed,
        ]
        R = LEVEL @ about(1, turns[0](t)) @ about(0, turns[1](t)) @ about(2, turns[2](t))
        end = np.stack([move(t) for move in moves], axis=1)
        frames = [(R, end)]
        end = end + R @ root
        for j, s in enumerate(CHAINS[finger]):
            joint = about(2, flexed[j])
            R = R @ (joint if j else joint @ about(0, deviates(t)) @ about(1, pronates(t)))
            end = end + R @ np.array([0.0, lengths[s], 0.0])
            frames.append((R, end))
        pulled = [
            Rotation.from_rotvec(b[:, None] * turned[s]).as_matrix() @ seats[s].as_matrix()
            for b, s in zip(bent, links)
        ]
        at = [
            (R @ (places[s] + b[:, None] * slid[s])[..., None])[..., 0]
            for (R, _), b, s in zip(frames, bent, links)
        ]
        return (
            np.stack([R @ pull for (R, _), pull in zip(frames, pulled)], axis=1),
            np.stack([end + p for (_, end), p in zip(frames, at)], axis=1),
        )

    values, biases = readings(rng, sensors, len(links))
    stream = Stream(
        "imu", links, (GYR, ACC), RATE, "imu", {GYR: float(np.radians(2000)), ACC: 16 * GRAVITY}
    )
    block = Block(stream, np.arange(len(values)) / RATE, values)
    q_BS = {s: quat.from_matrix(seats[s].as_matrix()) for s in links}
    arms = {}
    for j, s in enumerate(CHAINS[finger]):
        arms["near", s] = seats[s].inv().apply(np.array([0.0, -lengths[s], 0.0]) - places[s])
        arms["far", s] = seats[links[j]].inv().apply((root if j == 0 else 0.0) - places[links[j]])
    events = (Event(0.0, DURATION, "free_movement"),)
    recording = LoadedRecording(
        "left", hand, {}, {"imu": block}, events, source={"device": "simulated"}
    )
    return recording, Truth(lengths, q_BS, arms, dict(zip(links, biases))), finger


def readings(
    rng: np.random.Generator, sensors: Callable[[Array], tuple[Array, Array]], S: int
) -> tuple[Array, Array]:
    """Rates and specific forces (n, S, 6) with all a sensor's errors, of differences of rotations and places; the gyroscopes' biases (S, 3)."""
    t = np.arange(round(DURATION * RATE)) / RATE
    (R2, p2), (R1, p1), (R, p), (R3, p3), (R4, p4) = (
        sensors(t + k * STEP) for k in (-2, -1, 0, 1, 2)
    )
    a = (-p2 + 16 * p1 - 30 * p + 16 * p3 - p4) / (12 * STEP**2)
    W = np.swapaxes(R, -1, -2) @ (R2 - 8 * R1 + 8 * R3 - R4) / (12 * STEP)
    rate = np.stack([W[..., 2, 1], W[..., 0, 2], W[..., 1, 0]], axis=-1)
    force = np.einsum("tsji,tsj->tsi", R, a + [0.0, 0.0, GRAVITY])
    scales = np.eye(3) + 0.003 * rng.normal(size=(2, S, 3, 3))
    biases, pushed = np.radians(0.5) * rng.normal(size=(S, 3)), 0.05 * rng.normal(size=(S, 3))
    walk = np.cumsum(np.radians(0.001) * np.sqrt(1 / RATE) * rng.normal(size=rate.shape), axis=0)
    gyr = (
        np.einsum("sij,tsj->tsi", scales[0], rate)
        + biases
        + walk
        + GYR_NOISE * rng.normal(size=rate.shape)
    )
    acc = (
        np.einsum("sij,tsj->tsi", scales[1], force)
        + pushed
        + ACC_NOISE * rng.normal(size=force.shape)
    )
    steps = np.radians(2000) / 2**15, 16 * GRAVITY / 2**15
    return np.concatenate(
        [np.rint(v / step) * step for v, step in zip((gyr, acc), steps)], axis=-1
    ), biases


def solved(recording: LoadedRecording) -> list[method.Finger]:
    """The finger with the hand's skin left out, and with it among the unknowns."""
    found: list[method.Finger] = []
    together = method._together

    def watched(
        params: method.Params,
        recording: LoadedRecording,
        alone: list[method.Finger],
        progress: Callable[[float], None],
    ) -> tuple[list[method.Finger], list[str]]:
        counted, said = together(params, recording, alone, progress)
        found.extend([*alone, *counted])
        return counted, said

    with mock.patch.object(method, "_together", watched):
        method.solve(method.Params(), recording)
    return found


def errors(finger: method.Finger, true: Truth) -> dict[str, list[tuple[float, float]]]:
    """Error and standard deviation by what they are of."""
    at, links, told = finger.solution.at, finger.solution.problem.chain, finger.segments
    c, covariance = parameter_columns(links), finger.solution.factor.covariance
    found: dict[str, list[tuple[float, float]]] = {}
    for k, (s, length) in enumerate(told.lengths.items()):
        found.setdefault("length, next" if k else "length, first phalanx", []).append(
            (length - true.lengths[s], told.lengths_sd[s])
        )
    for k, j in enumerate(links.children):
        s = links.sensors[j]
        for name, arm, where in (("far", at.far[k], c.far), ("near", at.near[k], c.near)):
            u, b = arm / np.linalg.norm(arm), where.start + 3 * k
            off = np.linalg.norm(arm) - np.linalg.norm(true.arms[name, s])
            of = (
                "sensors from the finger's first joint"
                if k == 0
                else "sensors from the other joints"
            )
            found.setdefault(of, []).append(
                (float(off), float(np.sqrt(u @ covariance[b : b + 3, b : b + 3] @ u)))
            )
    for r, s in enumerate(links.sensors):
        off = quat.log(quat.multiply(told.q_BS[s], quat.conjugate(true.q_BS[s])))
        of = (
            "seats of hand and last phalanx"
            if s in ("hand", links.sensors[-1])
            else "seats of the others"
        )
        found.setdefault(of, []).extend(zip(off, finger.sure.q_BS[s]))
        sd = np.sqrt(np.diag(covariance))[c.bias_gyr][3 * r : 3 * r + 3]
        found.setdefault("gyroscopes' biases", []).extend(zip(at.bias_gyr[r] - true.biases[s], sd))
    return found


def told(title: str, people: Sequence[dict[str, list[tuple[float, float]]]]) -> None:
    sys.stdout.write(f"{title}\n")
    for name in people[0]:
        off, sd = np.array([pair for one in people for pair in one.get(name, [])]).T
        z = off / sd
        sys.stdout.write(
            f"  {name:40s} {np.sqrt(np.mean(z**2)):4.1f} ({np.abs(z).max():4.1f})  {np.sqrt(np.mean(off**2)):.2e} RMS\n"
        )


if __name__ == "__main__":
    first_seed, last_seed = map(int, sys.argv[1:])
    for skin in (0.0, 1.0):
        left_out, counted = [], []
        for seed in range(first_seed, last_seed):
            recording, true, _ = person(seed, skin)
            without, with_skin = solved(recording)
            left_out.append(errors(without, true))
            counted.append(errors(with_skin, true))
        said = "skin 2 deg and 1 mm for 90 deg" if skin else "no skin"
        told(
            f"{said}: under the hand's sensor left out; RMS (largest) in standard deviations, RMS in m or rad or rad/s",
            left_out,
        )
        told(f"{said}: among the unknowns", counted)
