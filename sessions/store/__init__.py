"""The data folder: database and recordings together, backup, erasure, export of a patient."""
