"""What an accelerometer at rest reads, where nobody knows better.

Source  standard gravity, 3rd CGPM 1901; between 9.780 and 9.832 m/s^2 on Earth (WGS 84)
"""

GRAVITY = 9.80665  # m/s^2
