"""Neighbours compared by their angular rates: what a joint leaves in common, and what moves together."""
