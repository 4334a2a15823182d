"""Patients, accounts, notes, results and the audit trail: functions on rows of the database."""
