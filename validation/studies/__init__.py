"""What errors cost, how they grow, whether standard deviations are honest."""
