"""Sensors against each other and against the hand: neighbours share a joint."""
