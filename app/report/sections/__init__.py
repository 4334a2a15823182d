"""The sections of a report, a file each: tables, figures and the words to read them."""
