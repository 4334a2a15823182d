"""The finger filter's options as its compiled kernels take them: by name, in SI units."""

from typing import NamedTuple


class KernelParams(NamedTuple):
    """Options of the updates, of the propagation and of the magnetometers; what each means stands beside the option that it comes from."""

    fused: bool  # verticals are the fused ones, not the accelerometers'
    inclination: float  # rad
    inclination_time: float  # s
    acc_noise: float  # m/s^2
    acc_error: float  # m/s^2
    acc_gate: float  # m/s^2
    rate_gate: float  # rad/s
    lever: float  # m
    dimensions: bool  # joints keep to the axes that they have
    dimension_noise: float  # rad
    correlation: float  # s
    rest_rate: float  # rad/s
    creeping: float  # rad/s
    inclination_by_rate: float  # s
    acc_bias: float  # m/s^2
    gyr_noise: float  # rad/s/sqrt(Hz)
    gyr_scale: float
    bias_walk: float  # rad/s/sqrt(s)
    mounting_walk: float  # rad/sqrt(s)
    mag_noise: float  # uT
    mag_error: float  # uT, 0 where magnetometers are not used
    mag_gate: float  # uT
