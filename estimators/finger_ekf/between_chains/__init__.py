"""What chains of the finger filter learn of sensors that they share, passed from one chain to another."""
