"""How often every process of the program looks for garbage."""

# thresholds of the collector: with Python's own a seventh of the time that imports take is its
GARBAGE = (20_000, 20, 20)
