"""Translating kernels to machine code, and keeping it."""
