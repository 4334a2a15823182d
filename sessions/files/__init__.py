"""Recordings as files: the native format, its recorder and reader, object storage.

A recording's checksum is computed by `native.file_checksum` and stored when the recording is closed
(store/records.py). It is verified where bytes come back: a file fetched from the object storage
(store/stored_files.py: `fetch_local`), a backup that is read (store/archive_entries.py:
`require_checksum`), a patient's export (store/patient_export.py).
"""
