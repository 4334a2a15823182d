"""Numerics without a domain: quaternions, Kalman updates, small matrices, compiled kernels."""
