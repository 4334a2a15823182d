"""The surface of the drawn hand: bones, skin, nails, and which bones carry which vertex."""
