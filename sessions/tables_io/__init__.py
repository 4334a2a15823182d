"""Tables and calibrations as files, written whole or not at all."""
