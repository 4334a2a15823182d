"""SlimeVR trackers by UDP."""
