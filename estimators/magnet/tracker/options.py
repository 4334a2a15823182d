"""Options of the magnet tracker: noise, limits, prior knowledge.

Out     the same in SI for the compiled filter
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.magnet.tracker.state import NoiseModel
from handscope.estimators.numerics.constants import GRAVITY

DEG = np.pi / 180
TURN_LENGTH = 0.5  # rad over which gravity along an axis changes as much as the random walk grows
GYR_CORRELATION_TIME = 0.5  # s
# variances of the gradients of a curl-free, divergence-free field and of the calibrated one, over a
# component's
GRADIENT_VARIANCE, CALIBRATED_VARIANCE = 9 / 5, 6 / 5
# variance of all of them an axis, mean over directions
ALL_GRADIENTS_VARIANCE = 1.0 + CALIBRATED_VARIANCE / 3
SOURCE = "BROAD, measured: decision 0011"
HMC5883L = "HMC5883L data sheet: 2 mG resolution; Kortier thesis 5.2.4"


@dataclass(frozen=True, kw_only=True)
class MagnetParams:
    """Options of the magnet tracker."""

    gyr_reading: str = option(
        "mean",
        "",
        "what a gyroscope's sample is, as in the fusion",
        "as the fusion's",
        ("mean", "instant"),
    )
    gyr_noise: float = option(
        0.03,
        "deg/s/sqrt(Hz)",
        "white noise density of a gyroscope axis",
        "LSM330DLC data sheet",
        least=1e-6,
    )
    gyr_share: float = option(
        0.003,
        "1",
        "share of its rate by which a moving gyroscope is off, alike for half a second",
        SOURCE,
        most=0.5,
    )
    acc_noise: float = option(
        0.003,
        "m/s^2/sqrt(Hz)",
        "white noise density of an accelerometer axis",
        "LSM330DLC data sheet",
        least=1e-6,
    )
    acc_error: float = option(
        0.01, "m/s^2", "what an accelerometer is off by for a while, its bias known", SOURCE
    )
    acc_share: float = option(
        0.003, "1", "share of the acceleration by which it is off besides", SOURCE, most=0.5
    )
    mag_noise: float = option(
        0.2,
        "uT",
        "white noise of a magnetometer axis; what its first readings show counts where it is half as much again",
        HMC5883L,
        least=1e-3,
    )
    mag_error: float = option(
        0.2,
        "uT",
        "what the calibration of a magnetometer leaves by itself",
        "HMC5883L data sheet: linear to 0.1 % of 2 G",
        least=1e-3,
    )
    field_gradient: float = option(
        2.3,
        "uT/m",
        "change of a component of the room's field, where the plate is worn and where it was calibrated",
        SOURCE,
        least=1e-3,
    )
    magnet_error: float = option(
        0.015,
        "1",
        "error of the magnet's moment and of the dipole as a model",
        "ours: moment found before use",
    )
    place_error: float = option(
        0.001, "m", "error of the magnetometers' places", "Kortier thesis 5.2.4: a ruler; size ours"
    )
    lever_error: float = option(
        0.001,
        "m",
        "error of the magnet's place on the hand",
        "Kortier thesis 5.2.4: a ruler; size ours",
    )
    latency_sd: float = option(
        0.03,
        "s",
        "how late or early the magnetometers' readings may be stamped against the inertial ones; beyond four of it what is told is doubtful",
        "ours: the filters and buffers of two chips; over 0.12 s a movement is no arc any more",
        least=1e-6,
    )
    acc_correlation_time: float = option(
        0.2,
        "s",
        "time over which what an accelerometer is off by stays alike while the hand moves",
        "ours",
        least=0.01,
    )
    mag_correlation_angle: float = option(
        3.0,
        "rad",
        "way that the trunk turns, there and back, over which what the calibration of a magnetometer leaves stays alike",
        "ours: it is linear in the field as the magnetometer sees it and comes back with it, so it lasts longer than one turn",
        least=0.01,
    )
    gyr_bias_sd: float = option(
        0.5,
        "deg/s",
        "bias of a gyroscope at the start",
        "data sheets after calibration",
        least=1e-6,
    )
    gyr_bias_walk: float = option(
        1e-4, "rad/s/sqrt(s)", "random walk of a gyroscope's bias", "Kortier thesis, Table 2.1"
    )
    acc_bias_sd: float = option(
        0.1, "m/s^2", "bias of an accelerometer at the start", "as the hand filter's", least=1e-6
    )
    acc_bias_walk: float = option(
        0.003, "m/s^2/sqrt(s)", "random walk of an accelerometer's bias", "ours"
    )
    field_walk: float = option(
        0.1,
        "uT/sqrt(s)",
        "change of the environment's field along itself and down",
        SOURCE,
        least=1e-6,
    )
    field_across: float = option(
        0.3,
        "uT",
        "by which the environment's field across itself differs where a seated trunk goes; what its other components have shown counts where it is more",
        f"2.3 uT/m over 13 cm: {SOURCE}",
        least=1e-6,
    )
    gate: float = option(
        0.05,
        "1",
        "share of g from which on a trunk counts as accelerated, for (5.17)",
        "Kortier thesis 5.2.2",
    )
    acc_still: float = option(
        0.1,
        "m/s^2",
        "error of gravity while a sensor stands still",
        "as the hand filter's, with bias",
        least=1e-3,
    )
    acc_moving: float = option(
        0.6, "m/s^2", "error of an acceleration in common, for (5.17)", "5 % of g", least=1e-3
    )
    acc_common: float = option(
        0.3,
        "m/s^2",
        "difference up to which trunk and hand are accelerated in common",
        "ours, for (5.17)",
    )
    trunk_speed: float = option(
        0.3,
        "m/s",
        "speed of the trunk of somebody who sits",
        "ours: a quick lean; half a metre a second at most",
        least=0.01,
    )
    speed_correlation_time: float = option(
        1.0, "s", "time over which that stays alike", "ours: half a lean", least=0.01
    )
    still_samples: int = option(
        9,
        "samples",
        "stretch that is looked at for a standstill",
        "Skog et al. 2010: 5 to 30",
        least=2,
        most=100,
    )
    still_gyr: float = option(
        4.0, "deg/s", "angular rate of what stands still", "as the hand filter's", least=0.01
    )
    still_acc: float = option(
        0.25,
        "m/s^2",
        "deviation from gravity of what stands still",
        "as the hand filter's",
        least=0.001,
    )
    still_speed: float = option(
        0.01, "m/s", "speed of what stands still", "as the hand filter's: tremor", least=1e-6
    )
    still_correlation_time: float = option(
        1.0,
        "s",
        "time over which the turning and travelling of what passes for standing still stay alike",
        "ours: a quarter of a breath (12 to 20 a minute); a slow lean or reach lasts as long",
        least=0.01,
    )
    reach: float = option(
        0.6,
        "m",
        "half the edge of the volume in which the hand can be",
        "ours: an arm's length",
        least=0.1,
        most=2.0,
    )
    reach_speed: float = option(
        0.7, "m/s", "usual speed of a hand against the trunk", "ours", least=0.05
    )
    inclination_sd: float = option(3.0, "deg", "inclination at the start", "ours", least=0.1)
    heading_sd: float = option(
        20.0, "deg", "heading of trunk and hand at the start", "ours", least=0.1
    )
    mag_range: float = option(
        810.0,
        "uT",
        "full scale of a magnetometer: a reading at it is left out",
        "HMC5883L data sheet",
        least=1.0,
    )
    gyr_range: float = option(
        2000.0, "deg/s", "full scale of a gyroscope", "LSM330DLC data sheet", least=1.0
    )
    acc_range: float = option(
        8.0, "g", "full scale of an accelerometer", "LSM330DLC data sheet", least=1.0
    )
    nis_limit: float = option(
        1.5,
        "1",
        "mean normalised innovation squared from which readings contradict what is known",
        "1 where all is as told; over half a second at 60 Hz four magnetometers stay below 1.3 (chi-squared, five standard deviations)",
        least=0.1,
    )
    doubtful_time: float = option(
        10.0,
        "s",
        "for which what readings have contradicted stays doubtful",
        "ours: a slow movement there and back; beside iron readings agree again in places, and what was learnt of them is not the truth",
    )
    deviation_limit: float = option(
        4.0,
        "1",
        "standard deviations by which readings move the moment, a place or a calibration away from what was told, beyond which it was told wrong or the "
        "room's field is not the same everywhere",
        "ours: normal errors of four magnetometers stay below it 499 times of 500",
        least=1.0,
    )
    min_p_value: float = option(
        0.001,
        "1",
        "chance that normal errors of the moment, places and calibrations move all of them together as far as readings do, below which something was told wrong "
        "or another magnet is near",
        "ours: once in a thousand recordings that are as told; chi-squared of as many as have been learnt",
        most=0.1,
    )
    max_gap: float = option(
        0.25, "s", "a longer gap forgets place and velocity", "as the fusion's", most=1.0
    )


def noise_model(p: MagnetParams, array_span: float = 0.0) -> NoiseModel:
    """Options in SI; `array_span` m is the RMS distance of the magnetometers from their middle."""
    return NoiseModel(
        **_inertial_noise(p),
        **_magnetic_noise(p, array_span),
        gravity=GRAVITY,
        gate=p.gate,
        trunk_speed=p.trunk_speed,
        speed_correlation_time=p.speed_correlation_time,
        still_acc=p.still_acc,
        still_speed=p.still_speed,
        still_rate=0.25 * p.still_gyr * DEG,
        still_correlation_time=p.still_correlation_time,
        reach=p.reach,
        reach_speed=p.reach_speed,
        max_gap=p.max_gap,
        nis_limit=p.nis_limit,
    )


def _inertial_noise(p: MagnetParams) -> dict[str, float]:
    """Of the gyroscope and the accelerometer."""
    slow = np.sqrt(2 * p.acc_correlation_time)
    return {
        "gyr": p.gyr_noise * DEG,
        "gyr_moving": p.gyr_share * np.sqrt(2 * GYR_CORRELATION_TIME),
        "gyr_walk": p.gyr_bias_walk,
        "mean_rates": float(p.gyr_reading == "mean"),
        "acc": p.acc_noise,
        "acc_slow": p.acc_error * slow,
        "acc_moving_slow": p.acc_share * slow,
        "acc_correlation_time": p.acc_correlation_time,
        "acc_walk": p.acc_bias_walk,
        "acc_turned": p.acc_share * GRAVITY * np.sqrt(TURN_LENGTH),
        "acc_still": p.acc_still,
        "acc_moving": p.acc_moving,
        "acc_common": p.acc_common,
    }


def _magnetic_noise(p: MagnetParams, array_span: float) -> dict[str, float]:
    """Of the magnetometers and the field of the room."""
    of_array = ALL_GRADIENTS_VARIANCE * (p.field_gradient * array_span) ** 2
    return {
        "mag": 1e-6 * p.mag_noise,
        "mag_residual": 1e-6 * p.mag_error,
        "mag_correlation_angle": p.mag_correlation_angle,
        "gradient": 1e-6 * p.field_gradient * float(np.sqrt(GRADIENT_VARIANCE)),
        "single": 1e-6 * float(np.sqrt(p.mag_noise**2 + p.mag_error**2 + of_array)),
        "field_walk": 1e-6 * p.field_walk,
        "field_across": 1e-6 * p.field_across,
    }
