"""The filter of one sensor's orientation as the library has it, and its options.

In      rates, rad/s, and specific forces, m/s^2, in the sensor's frame
Out     q_GS: takes vectors from the sensor to the global frame (z up)
Source  VQF: Laidig & Seel 2023, Information Fusion 91:187 (package vqf)
"""

from dataclasses import dataclass

import numpy as np
from vqf import VQF

from estimators.options import option
from estimators.quaternions import Array


@dataclass(frozen=True, kw_only=True)
class FusionParams:
    tau_acc: float = option(
        3.0,
        "s",
        "time constant of the accelerometer's correction: larger trusts the gyroscope longer",
        "VQF default (Laidig & Seel 2023)",
        least=0.01,
    )
    rest_bias: bool = option(True, "", "estimate the gyroscope's bias whenever the sensor rests", "VQF default (Laidig & Seel 2023)")
    motion_bias: bool = option(True, "", "estimate the gyroscope's bias during movement", "VQF default (Laidig & Seel 2023)")
    rest_gyr: float = option(
        2.0, "deg/s", "largest deviation of the angular rate that counts as rest", "VQF default (Laidig & Seel 2023)", least=0.01
    )
    rest_turn: float = option(
        0.1,
        "deg/s",
        "rate at which a sensor that seems to rest still turns (standard deviation): a bias found at rest is no better known",
        "ours: skin under a still hand's sensor turns while fingers move; VQF's 0.03 is for sensors laid down (docs/reproduction.md, drift)",
        least=0.001,
    )
    rest_acc: float = option(
        0.5, "m/s^2", "largest deviation of the acceleration that counts as rest", "VQF default (Laidig & Seel 2023)", least=0.01
    )
    tau_mag: float = option(
        9.0, "s", "time constant of the magnetometer's correction of the heading", "VQF default (Laidig & Seel 2023)", least=0.01
    )
    gyr_reading: str = option(
        "mean",
        "",
        "what a gyroscope's sample is: the mean rate since the one before, as filtered sensors give it, or the rate at its instant",
        "ours: on ten real trials (BROAD) inclination 0.76 deg with mean, 0.94 deg with instant",
        ("mean", "instant"),
    )
    mag_rejection: bool = option(
        True,
        "",
        "leave the magnetometer out while its field differs in strength or dip from the one learnt",
        "VQF default (Laidig & Seel 2023); the paper's filter has none",
    )
    max_gap: float = option(
        0.25, "s", "longest stretch of missing samples that is bridged by interpolation", "ours: docs/methods.md, lost samples", most=1.0
    )


def begun(params: FusionParams, period: float) -> VQF:
    """The library's filter before its first sample; samples come every `period` s."""
    return VQF(
        period,
        tauAcc=params.tau_acc,
        motionBiasEstEnabled=params.motion_bias,
        restBiasEstEnabled=params.rest_bias,
        restThGyr=params.rest_gyr,
        biasSigmaRest=params.rest_turn,
        restThAcc=params.rest_acc,
        tauMag=params.tau_mag,
        magDistRejectionEnabled=params.mag_rejection,
    )


def updated(vqf: VQF, gyr: Array, acc: Array) -> Array:
    """Orientations (n, 4) by gyroscope and accelerometer, (n, 3) each; the library's call for many samples costs a single one three times as much."""
    if len(gyr) == 1:
        vqf.update(gyr[0], acc[0])
        return np.asarray(vqf.getQuat6D())[None]
    return np.asarray(vqf.updateBatch(gyr, acc)["quat6D"])
