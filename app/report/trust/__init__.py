"""Whether figures can be trusted, and which messages say why."""
