"""Figures from simulators that share no code with the program."""
