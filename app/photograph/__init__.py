"""The printed sheet, and what is read off a photograph of a hand on it."""
