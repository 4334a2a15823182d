"""From which side viewers see the hand, and how their cameras move there."""
