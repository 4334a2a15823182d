"""Live stations: one glove, one patient's session, one scene, led by a wizard."""
