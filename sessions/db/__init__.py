"""The database: tables, conflicts, migrations."""
