"""What is kept: recordings, patients, sessions, results; import and export. Knows the data types of `estimators`, nothing of `app`."""
