"""Gloves by what their recordings tell."""
