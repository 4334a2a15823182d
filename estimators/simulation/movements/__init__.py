"""What the simulated person does: tasks, grips and calibration movements."""
