"""Recordings and tables of other programs, and the derivative that Handscope writes."""
