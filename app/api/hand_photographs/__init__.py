"""Photographs of hands on the printed sheet."""
