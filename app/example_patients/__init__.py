"""Simulated patients of the demonstration, so that lists, trends, comparisons and reports have something to show."""
