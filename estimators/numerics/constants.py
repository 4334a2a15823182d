"""Physical constants.

Source  standard gravity, 3rd CGPM 1901 (9.780 to 9.832 m/s^2 on Earth, WGS 84); vacuum
        permeability, CGPM 1948
"""

GRAVITY = 9.80665  # m/s^2
MU0_4PI = 1e-7  # T m / A
