"""Sources of live data that do not speak the wire protocol: each is a file here and a line in app/devices/ports.py."""
