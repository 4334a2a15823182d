"""Heading of the thumb's metacarpal from the acceleration of its joint with the hand (Kok et al. 2014; Weygers & Kok 2020)."""
