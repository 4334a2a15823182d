"""Simulators that share nothing with the program they test: numpy and scipy alone, rotations, hands, sensors, fields and files written anew.

What the program and its own simulator have in common (a frame, a sign, a model of an error) they could have wrong alike; here that would show.
"""
