"""Treatment of a patient by day, and goals of figures: rows of the database."""
