"""Treatment of a patient, and goals of figures."""
