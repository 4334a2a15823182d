"""What flows: blocks of samples, events, calibrations, trajectories, findings, and the options of
methods."""
