"""The error-state Kalman filter of the fingers (Kortier, thesis, chapter 2)."""
