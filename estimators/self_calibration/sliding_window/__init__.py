"""Self-calibration while the hand moves: a window that slides and a marginal prior behind it."""
