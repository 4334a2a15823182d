"""Fingertip forces and the object between the fingers: Kortier, thesis ch. 6 (docs/methods/forces.md has equation -> function)."""
