"""Localising a magnet from an array of magnetometers without inertial sensors."""
