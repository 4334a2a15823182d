"""The free movement that a hand is self-calibrated from, in the form of app/protocols."""
