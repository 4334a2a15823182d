"""The error-state Kalman filter of trunk and hand (Kortier, thesis, chapter 5), and its smoother."""
