"""From recordings and live streams to the position of the hand."""
