"""The patient's screen: its routes for the therapist, and those of the screen itself."""
