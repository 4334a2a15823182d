"""How sure the checks have to be, once for all of them."""

FALSE_ALARMS = 0.0008  # of recordings without a fault, a check: five checks stay below 1 in 200
RAREST = 1e-6  # probability below which no smaller one is told


def odds_of(p: float) -> float:
    """One in how many recordings without the fault shows as much, 1 / RAREST at most."""
    return float(1.0 / max(p, RAREST))
