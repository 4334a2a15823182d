"""Lengths and in-plane angles of a flat hand from one photograph of it on a printed sheet."""
