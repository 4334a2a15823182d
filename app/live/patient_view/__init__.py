"""What the patient sees of a live session on a screen of their own."""
