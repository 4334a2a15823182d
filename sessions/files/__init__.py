"""Recordings as files: the native format, its recorder and reader, object storage."""
