"""The progress report: a patient's figures over all sessions."""
