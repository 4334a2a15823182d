"""Exports of results: gathers what a format needs, and saves its files whole or not at all."""
