"""All fingers at once, sharing the hand."""
