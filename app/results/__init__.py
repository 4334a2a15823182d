"""Results of sessions: made from recordings, stored, compared, reported, also for whole cohorts."""
