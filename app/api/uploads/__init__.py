"""Files of other programs: tables of loggers, and hand landmarks of a camera."""
