"""Orientation of single sensors: fusion, resampling, headings from joint constraints."""
