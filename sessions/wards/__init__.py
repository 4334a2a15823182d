"""Wards of a hospital: which patients an account sees, and access to others in an emergency."""
