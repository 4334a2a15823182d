"""Makers' own formats as tables of numbers whose column names say segment and quantity."""
