"""The dipole and the places of magnetometers and magnet."""
