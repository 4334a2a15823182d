"""Checks of a recording before its figures are trusted: sensors against themselves, against each other and against the hand."""
