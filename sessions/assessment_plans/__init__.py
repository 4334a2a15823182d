"""A clinic's own versions of assessment plans, every one of them for good: sessions name the one they had."""
