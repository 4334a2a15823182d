"""How sure the estimated parameters are: covariances and draws."""
