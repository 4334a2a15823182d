"""The data folder: database and recordings together, backup, erasure, export of a patient.

Where a recording's checksum is computed and verified: sessions/files/__init__.py.
"""
