"""The camera that took a picture of the sheet: where it stood, and how its lens draws.

In      corners of markers on the sheet (n, 3), m, and in the picture (n, 2), pixels; the picture's
        size; the lens's focal length where the picture states it
Out     Camera with the covariance of its parameters; places on planes above the sheet of points in
        the picture
Source  pinhole with two radial coefficients and Gauss-Newton over all corners: Zhang 2000,
        IEEE TPAMI 22:1330; homography as the beginning: ibid., appendix A
Limits  one picture determines focal length and height only together: the prior on the focal length
        decides how well heights above the sheet are corrected
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import least_squares

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

FULL_FRAME = 43.27  # mm, diagonal of the film that focal lengths are compared on
FOCAL, FOCAL_SD = 0.75, 0.12  # of the larger side: phones' main cameras, 24 to 30 mm on that film
GIVEN_FOCAL_SD = 0.04  # share, of a focal length that the picture states: it is rounded to 1 mm
CENTRE_SD = 0.015  # of the larger side: where the lens's axis meets the picture
RADIAL_SD = 0.10  # of both coefficients: phones draw within a few per cent of a pinhole
MOST_STEPS = 200  # of a search: rendered photographs take 23 at most, a damaged picture went on for 20 s; it misses the sheet then
CORNER_SD = 0.4  # pixels, of a marker's corner at least


@dataclass(frozen=True)
class Camera:
    """A camera above the sheet; picture coordinates in pixels, the sheet's in m."""

    size: tuple[int, int]  # pixels, width and height
    focal: float  # of the larger side
    centre: Array  # (2,) of the larger side, from the middle of the picture
    radial: Array  # (2,) of the squared tangent of a ray's angle, and of its square
    q_cs: Array  # (4,) takes vectors from the sheet to the camera: x right, y down, z forwards
    p_c: Array  # (3,) m, the sheet's origin in the camera's frame
    covariance: Array  # (11, 11) of log focal, centre, radial, rotation (rad), p_c
    misfit: float  # m on the sheet, RMS of the markers' corners

    @property
    def tilt(self) -> float:
        """Between the lens's axis and the sheet's normal, rad."""
        normal = np.asarray(quat.rotate(self.q_cs, np.array([0.0, 0.0, 1.0])))
        return float(np.arccos(min(1.0, abs(normal[2]))))

    @property
    def place(self) -> Array:
        """Where the lens is in the sheet's frame (3,), m."""
        return np.asarray(-quat.rotate(quat.conjugate(self.q_cs), self.p_c))

    def project(self, points: Array) -> Array:
        """Pictures (n, 2) of points (n, 3) in the sheet's frame."""
        x, y, z = np.moveaxis(quat.rotate(self.q_cs, points) + self.p_c, -1, 0)
        u = np.stack([x, y], axis=-1) / z[..., None]
        larger, middle = max(self.size), np.array(self.size) / 2
        drawn = self.centre + self.focal * u * _drawn(u, self.radial)
        return np.asarray(middle + larger * drawn)

    def place_at(self, pixels: Array, height: Array) -> Array:
        """Where points (n, 2) of the picture lie (n, 2), m, if they are `height` (n,) above the
        sheet."""
        larger, middle = max(self.size), np.array(self.size) / 2
        u = straighten(((pixels - middle) / larger - self.centre) / self.focal, self.radial)
        inverse = quat.conjugate(self.q_cs)
        ray = quat.rotate(inverse, np.concatenate([u, np.ones((len(u), 1))], axis=-1))
        lens = self.place
        along = (height - lens[2]) / ray[:, 2]
        return np.asarray(lens[:2] + along[:, None] * ray[:, :2])

    def perturb(self, d: Array) -> "Camera":
        """The camera with its parameters changed by d (11,)."""
        return replace(
            self,
            focal=float(self.focal * np.exp(d[0])),
            centre=self.centre + d[1:3],
            radial=self.radial + d[3:5],
            q_cs=quat.multiply(self.q_cs, quat.exp(d[5:8])),
            p_c=self.p_c + d[8:11],
        )


def locate(sheet: Array, pixels: Array, size: tuple[int, int], focal: float | None) -> Camera:
    """The camera from corners on the sheet (n, 3) and in the picture (n, 2); `focal` is of the
    larger side, None where the picture does not tell it."""
    start = _start(sheet[:, :2], pixels, size, focal or FOCAL)
    prior_sd = np.array(
        [GIVEN_FOCAL_SD if focal else FOCAL_SD, CENTRE_SD, CENTRE_SD, RADIAL_SD, RADIAL_SD]
    )

    def residuals(d: Array, sd: float) -> Array:
        camera = start.perturb(d)
        off = (camera.project(sheet) - pixels) / sd
        return np.concatenate([off.ravel(), d[:5] / prior_sd])

    search = partial(least_squares, x_scale="jac", max_nfev=MOST_STEPS)
    found = search(partial(residuals, sd=CORNER_SD), np.zeros(11))
    off = residuals(found.x, 1.0)[: 2 * len(sheet)]
    sd = max(CORNER_SD, float(np.sqrt((off**2).sum() / max(1, 2 * len(sheet) - 6))))
    found = search(partial(residuals, sd=sd), found.x)
    camera, jacobian = start.perturb(found.x), np.asarray(found.jac)
    on_sheet = camera.place_at(pixels, np.zeros(len(pixels))) - sheet[:, :2]
    return replace(
        camera,
        covariance=np.linalg.inv(jacobian.T @ jacobian),
        misfit=float(np.sqrt((on_sheet**2).sum(axis=1).mean())),
    )


def share_of_side(focal_mm: float, size: tuple[int, int]) -> float:
    """A focal length on 35 mm film, mm, as a share of the larger side of a picture of this size."""
    return focal_mm / FULL_FRAME * float(np.hypot(*size)) / max(size)


def straighten(drawn: Array, radial: Array) -> Array:
    """Directions (n, 2) that a lens draws at `drawn` (n, 2): the inverse of its distortion."""
    u = drawn
    for _ in range(8):
        u = drawn / _drawn(u, radial)
    return u


def homography(sheet: Array, pixels: Array) -> Array:
    """H (3, 3) with pixels ~ H (x, y, 1), by the normalised direct linear transformation."""
    to_sheet, to_pixels = _normaliser(sheet), _normaliser(pixels)
    a, b = _homogeneous(sheet) @ to_sheet.T, _homogeneous(pixels) @ to_pixels.T
    zero = np.zeros_like(a)
    rows = np.concatenate(
        [
            np.concatenate([a, zero, -b[:, :1] * a], axis=1),
            np.concatenate([zero, a, -b[:, 1:2] * a], axis=1),
        ]
    )
    h = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    return np.asarray(np.linalg.inv(to_pixels) @ h @ to_sheet)


def _start(sheet: Array, pixels: Array, size: tuple[int, int], focal: float) -> Camera:
    """A pinhole of that focal length where the homography has it."""
    larger = max(size)
    h = homography(sheet, (pixels - np.array(size) / 2) / larger)
    h = np.diag([1 / focal, 1 / focal, 1.0]) @ h
    h = h / np.sqrt(np.linalg.norm(h[:, 0]) * np.linalg.norm(h[:, 1]))
    h = h * np.sign(h[2, 2])  # the sheet is before the camera
    u, _, v = np.linalg.svd(np.column_stack([h[:, 0], h[:, 1], np.cross(h[:, 0], h[:, 1])]))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    q_cs = quat.from_matrix(rotation)
    return Camera(size, focal, np.zeros(2), np.zeros(2), q_cs, h[:, 2], np.zeros((11, 11)), np.inf)


def _drawn(u: Array, radial: Array) -> Array:
    square = (u**2).sum(axis=-1, keepdims=True)
    return np.asarray(1.0 + radial[0] * square + radial[1] * square**2)


def _homogeneous(points: Array) -> Array:
    return np.concatenate([points, np.ones((len(points), 1))], axis=1)


def _normaliser(points: Array) -> Array:
    mean, wide = points.mean(axis=0), float(points.std())
    return np.array([[1 / wide, 0, -mean[0] / wide], [0, 1 / wide, -mean[1] / wide], [0, 0, 1]])
