"""What runs: devices, live stations, wizard, scene, HTTP API, reports, command line."""
