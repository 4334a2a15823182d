"""Stored figures of photographs of patients' hands on the printed sheet."""
