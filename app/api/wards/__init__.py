"""Wards, and emergency access to patients of others."""
