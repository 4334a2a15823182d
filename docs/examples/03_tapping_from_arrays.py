"""Finger tapping without a glove: gyroscopes on two nails, or an angle that a camera saw, as plain arrays.

python docs/examples/03_tapping_from_arrays.py
"""

import numpy as np

import handscope as hs
from handscope.estimators.measures import tapping

rng = np.random.default_rng(0)
t = np.arange(0, 15, 1 / 60) + rng.uniform(-0.003, 0.003, 900)  # a camera's uneven frames
angle = np.radians(
    (50 - 1.2 * t) * 0.5 * (1 - np.cos(2 * np.pi * 2.5 * t))
)  # 2.5 taps a second that become smaller
angle += np.radians(rng.normal(0, 1, len(t)))
angle[300:330] = np.nan  # the hand was hidden for half a second

trial = tapping.of_angle(t, angle)
for figure in tapping.figures(trial):
    sd = f" ± {figure.sd:.3g}" if figure.sd is not None else ""
    print(
        f"{figure.name:36s} {figure.value:8.3g}{sd} {figure.unit:6s} {figure.grade}  {figure.reason}"
    )

slope = np.gradient(
    angle_of := np.radians(25 * (1 - np.cos(2 * np.pi * 2.5 * np.arange(0, 15, 0.005)))), 0.005
)
thumb, index = (
    0.3 * slope[:, None] * [0.6, 0.8, 0.0],
    0.7 * slope[:, None] * [0.0, 0.0, -1.0],
)  # rad/s, mounted anyhow
gyroscopes = tapping.of_rates(np.arange(len(slope)) * 0.005, thumb, index)
print(
    f"gyroscopes: {gyroscopes.rate:.2f} taps a second, {np.degrees(gyroscopes.amplitudes.mean()):.0f} deg (put in: {np.degrees(np.ptp(angle_of)):.0f})"
)

try:
    tapping.of_angle(t[::-1], angle)
except hs.InputError as mistake:
    print("what happens to bad input:", mistake)
