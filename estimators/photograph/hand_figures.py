"""Lengths, places of joints and in-plane angles of a hand that lies on the sheet.

In      landmarks marked in one picture or several of the hand as it lies, pixels; the cameras; the
        hand's side
Out     Figures: phalanx lengths, joint centres in the hand's frame, deviations of fingers and
        wrist, each with its standard deviation
Method  one picture: each landmark at the height that hands of this length have. Several: heights,
        marks and cameras err as believed (a Gaussian), conditioned on every picture having each
        landmark at the same place, so pictures from different sides determine the heights
Source  hand's axes: Salchow-Hoemmen 2019, 2.2.2, y from the wrist's centre to MCP 3; thickness of
        wrist, hand and fingers as shares of the hand's length, and how much people differ: ours
Limits  a mark is taken to lie above the joint's centre; how far the centre under the skin is from
        where a person sees it is counted by `mark_sd` alone. The hand lies flat: a joint that is
        bent makes its phalanges shorter. Of the thumb the deviation at the CMC joint is found,
        flexion and pronation cannot be seen from above
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, Hand, side_sign
from handscope.estimators.hand.geometry import TIP_TISSUE, TIP_TISSUE_SD, root_joint
from handscope.estimators.numerics.tail_probabilities import chi2_sf
from handscope.estimators.numerics.typing import Array
from handscope.estimators.photograph.camera import Camera
from handscope.estimators.photograph.sheet import ARM_LANDMARKS, FINGER_LANDMARKS, LANDMARKS

MARK_SD = 0.5e-3  # m on the sheet, of each coordinate of a mark; size ours
HIDDEN = 3.0  # times that, of the thumb's CMC joint, which no crease shows
# of the hand's length, above the paper: the sides of wrist and forearm half way up, the skin above
# joints, the outline of a fingertip
HEIGHT = {
    "wrist": 0.10,
    "root": 0.14,
    "thumb_cmc": 0.16,
    "second": 0.096,
    "third": 0.072,
    "tip": 0.035,
}
HEIGHT_SD = 0.10  # share of itself: of a person's hand as a whole, and of each joint again
STEP = 1e-4  # of the numerical derivative: m, rad or shares
ROUNDS = 3  # of Gauss-Newton: a hand's heights are linear in what they move to 0.1 mm after two
DISAGREE = 1e-4  # probability of pictures that fit less well though nothing else errs
HAND_LENGTH = (0.10, 0.26)  # m, plausible on a sheet
MARK_WEIGHTS = {f: np.ones(4) for f in FINGERS} | {"thumb": np.array([1 / HIDDEN**2, 1, 1, 1])}


@dataclass(frozen=True)
class Figures:
    """Figures of a hand from a photograph; SI, each with its standard deviation."""

    hand: Hand
    lengths: Mapping[str, float]  # m, functional, by segment; "hand" is the palm
    lengths_sd: Mapping[str, float]
    joint_positions: Mapping[str, tuple[float, float, float]]  # m, in the hand's frame
    joint_positions_sd: Mapping[str, float]  # m, of each coordinate in the plane
    deviation: Mapping[str, float]  # rad, ulnar positive, by joint
    deviation_sd: Mapping[str, float]


@dataclass(frozen=True)
class View:
    """A picture in which all LANDMARKS were marked."""

    camera: Camera
    marks: Mapping[str, Array]  # (2,) pixels, by name


def measure(views: Sequence[View], hand: Hand, mark_sd: float = MARK_SD) -> Figures:
    """The figures of a hand that lies alike in all views.

    InputError where landmarks are missing, or where the views do not have them at the same places.
    """
    pixels = [_pixels_of(view.marks) for view in views]
    length = _hand_length(views[0].camera.place_at(pixels[0], np.zeros(len(LANDMARKS))))
    if not HAND_LENGTH[0] < length < HAND_LENGTH[1]:
        raise InputError("photograph.landmarks_no_hand", length=1e3 * length)
    height, n = landmark_heights(length), len(LANDMARKS)

    def places(causes: Array) -> Array:
        """Of the landmarks (views, n, 2) by errors of heights (1 + n), and each view's: its camera's (11), its marks' (2 n)."""
        at = height * (1.0 + causes[0] + causes[1 : 1 + n])
        own = causes[1 + n :].reshape(len(views), -1)
        seen = [
            view.camera.perturb(c[: -2 * n]).place_at(p, at) + c[-2 * n :].reshape(n, 2)
            for view, p, c in zip(views, pixels, own)
        ]
        return np.array(seen)

    causes, covariance = _agreed(places, _causes(views, mark_sd))

    def of_causes(d: Array) -> Array:
        return _as_vector(_figures(places(causes + d)[0], hand))

    jacobian = _derivative(of_causes, len(causes))
    sd = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian))
    return _figures_of(_figures(places(causes)[0], hand), sd, hand)


def _agreed(places: Callable[[Array], Array], prior: Array) -> tuple[Array, Array]:
    """Errors (m,) of which all views have the landmarks at the same places, and their covariance."""
    causes, covariance = np.zeros(len(prior)), prior

    def difference(d: Array) -> Array:
        found = places(causes + d)
        return np.asarray((found[1:] - found[0]).ravel())

    if not len(difference(causes)):  # one view agrees with itself
        return causes, covariance
    for _ in range(ROUNDS):
        off, H = difference(np.zeros(len(prior))), _derivative(difference, len(prior))
        S = H @ prior @ H.T
        gain = np.linalg.solve(S, H @ prior).T
        expected = H @ causes - off
        causes, covariance = gain @ expected, prior - gain @ H @ prior
    _require_agreement(expected, S)
    return causes, covariance


def _require_agreement(off: Array, S: Array) -> None:
    """Nowhere else must a landmark lie in a picture than all others let expect; `off` (m,) m of covariance S."""
    information = np.linalg.inv(S)
    pull = information @ off
    for name, at in zip(
        LANDMARKS, np.arange(len(off)).reshape(-1, len(LANDMARKS), 2).swapaxes(0, 1)
    ):
        rows = at.ravel()
        shift = np.linalg.solve(information[np.ix_(rows, rows)], pull[rows])
        if len(LANDMARKS) * chi2_sf(pull[rows] @ shift, len(rows)) < DISAGREE:
            raise InputError(
                "photograph.pictures_disagree",
                landmark=name.replace("_", " "),
                distance=1e3 * float(np.linalg.norm(shift.reshape(-1, 2), axis=1).max()),
            )


def _pixels_of(marks: Mapping[str, Array]) -> Array:
    missing = [name for name in LANDMARKS if name not in marks]
    if missing:
        raise InputError("photograph.landmarks_missing", names=", ".join(missing))
    try:
        pixels = np.array([marks[name] for name in LANDMARKS], dtype=float)
    except (TypeError, ValueError):
        raise InputError("photograph.landmarks_unreadable") from None
    if pixels.shape != (len(LANDMARKS), 2) or not np.isfinite(pixels).all():
        raise InputError("photograph.landmarks_unreadable")
    return pixels


def _causes(views: Sequence[View], mark_sd: float) -> Array:
    """Covariance of everything that errs, in the order of `measure`."""
    n = len(LANDMARKS)
    sd = mark_sd * np.where(np.array(LANDMARKS) == "thumb_cmc", HIDDEN, 1.0)
    marks = np.diag(np.repeat(sd, 2) ** 2)
    blocks = [np.eye(1 + n) * HEIGHT_SD**2 / 2]
    blocks += [block for view in views for block in (view.camera.covariance, marks)]
    covariance, first = np.zeros((sum(map(len, blocks)),) * 2), 0
    for block in blocks:
        rows = slice(first, first + len(block))
        covariance[rows, rows], first = block, first + len(block)
    return covariance


def landmark_heights(hand_length: float) -> Array:
    """How high above the paper (n,) each of LANDMARKS is seen, m."""
    return hand_length * np.array([HEIGHT[_level(name)] for name in LANDMARKS])


def _level(name: str) -> str:
    if name in ARM_LANDMARKS:
        return "wrist"
    if name == "thumb_cmc":
        return name
    chain = next(c for c in FINGER_LANDMARKS.values() if name in c)
    return ("root", "second", "third", "tip")[chain.index(name)]


def _hand_length(at: Array) -> float:
    place = dict(zip(LANDMARKS, at))
    wrist = (place["wrist_radial"] + place["wrist_ulnar"]) / 2
    return float(np.linalg.norm(place["middle_tip"] - wrist))


@dataclass(frozen=True)
class _Flat:
    """Figures of places on the sheet, each as arrays."""

    lengths: dict[str, float]
    places: dict[str, Array]  # (2,) distal, ulnar
    deviation: dict[str, float]


def _figures(at: Array, hand: Hand) -> _Flat:
    """Of landmarks (n, 2) on the sheet, m."""
    place = dict(zip(LANDMARKS, at))
    wrist = (place["wrist_radial"] + place["wrist_ulnar"]) / 2
    arm = wrist - (place["forearm_radial"] + place["forearm_ulnar"]) / 2
    distal = place["middle_mcp"] - wrist
    palm = float(np.linalg.norm(distal))
    distal = distal / palm
    # from above, palm down, ulnar is left of distal on the left hand
    ulnar = np.array([-distal[1], distal[0]]) * side_sign(hand)
    axes = np.stack([distal, ulnar])
    lengths, places = {"hand": palm}, {}
    deviation = {"wrist": -_towards_ulnar(axes @ arm)}
    for finger, chain in FINGER_LANDMARKS.items():
        points = np.array([place[name] for name in chain])
        bones = np.linalg.norm(np.diff(points, axis=0), axis=1)
        bones[-1] -= TIP_TISSUE[finger]
        lengths |= dict(zip(CHAINS[finger], bones))
        places[root_joint(finger)] = axes @ (points[0] - wrist)
        along = _direction(points, MARK_WEIGHTS[finger])
        deviation[root_joint(finger)] = _towards_ulnar(axes @ along)
    return _Flat(lengths, places, deviation)


def _direction(points: Array, weights: Array) -> Array:
    """Of the straight line (2,) closest to points (n, 2), from the first to the last."""
    from_mean = points - weights @ points / weights.sum()
    along = np.linalg.svd(np.sqrt(weights)[:, None] * from_mean, full_matrices=False)[2][0]
    return np.asarray(along * np.sign(along @ (points[-1] - points[0])))


def _towards_ulnar(distal_ulnar: Array) -> float:
    """Angle of a direction (2,) from distal towards ulnar, rad."""
    return float(np.arctan2(distal_ulnar[1], distal_ulnar[0]))


def _as_vector(flat: _Flat) -> Array:
    return np.concatenate(
        [[*flat.lengths.values()], *flat.places.values(), [*flat.deviation.values()]]
    )


def _derivative(function: Callable[[Array], Array], n: int) -> Array:
    """(figures, n), by central differences about zero."""
    steps = STEP * np.eye(n)
    return np.stack([(function(d) - function(-d)) / (2 * STEP) for d in steps], axis=-1)


def _figures_of(flat: _Flat, sd: Array, hand: Hand) -> Figures:
    n, m, sign = len(flat.lengths), len(flat.places), side_sign(hand)
    lengths_sd = dict(zip(flat.lengths, map(float, sd[:n])))
    for finger in FINGERS:
        last = CHAINS[finger][-1]
        lengths_sd[last] = float(np.hypot(lengths_sd[last], TIP_TISSUE_SD[finger]))
    places_sd = sd[n : n + 2 * m].reshape(m, 2).max(axis=1)
    return Figures(
        hand,
        {name: float(value) for name, value in flat.lengths.items()},
        lengths_sd,
        {
            name: (0.0, float(sign * distal), float(sign * ulnar))
            for name, (distal, ulnar) in flat.places.items()
        },
        dict(zip(flat.places, map(float, places_sd))),
        flat.deviation,
        dict(zip(flat.deviation, map(float, sd[n + 2 * m :]))),
    )
