"""Sensor-to-segment alignment: the initial pose, functional movements, and checks of how sensors
are mounted."""
