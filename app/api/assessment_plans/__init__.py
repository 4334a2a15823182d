"""Assessment plans over the API."""
