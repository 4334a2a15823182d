"""Recording in, trajectory out."""
