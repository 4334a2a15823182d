"""Routes of sessions while they run."""
