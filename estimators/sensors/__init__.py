"""Single sensors: calibration, saturation, missing samples, faults, rest."""
