"""Bad input by the thousand: every reader of bytes that come from elsewhere, and the API by its own description. What was found stays in `found/`."""
