"""The hand relative to the trunk by a permanent magnet (Kortier, thesis, chapter 5)."""
