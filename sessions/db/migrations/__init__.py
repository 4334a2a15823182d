"""Schema changes, one file each, run in order when the database is opened."""
