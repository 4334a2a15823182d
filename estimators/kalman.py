"""What measurements tell of a filter's errors, for one row of a kernel.

In      covariance P (e, e) of the errors, changed in place; what each measurement missed (m,), its Jacobian H (m, e), their noise (m, m)
Out     the change of the errors' means (e,)
Source  Kortier, thesis (2.14), (2.15), written with the Cholesky factor of the innovation's covariance: P stays symmetric to the last bit
"""

import math

import numpy as np

from estimators.compiled import inlined
from estimators.quaternions import Array
from estimators.small_matrices import product


@inlined
def correct(P: Array, missed: Array, H: Array, noise: Array, change: Array) -> None:
    """With S = H P H' + noise = L L', W = L^-1 H P and y = L^-1 missed the gain K gives K missed = W' y and K H P = W' W."""
    m, e = H.shape
    W, L, y = np.empty((m, e)), np.empty((m, m)), np.empty(m)
    product(H, P, W)
    for i in range(m):
        for j in range(i + 1):
            s = noise[i, j]
            for k in range(e):
                if H[j, k] != 0.0:
                    s += W[i, k] * H[j, k]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = math.sqrt(s) if i == j else s / L[j, j]
    for k in range(e):
        change[k] = 0.0
    for i in range(m):
        y[i] = missed[i]
        for j in range(i):
            if L[i, j] != 0.0:
                y[i] -= L[i, j] * y[j]
                for k in range(e):
                    W[i, k] -= L[i, j] * W[j, k]
        y[i] /= L[i, i]
        for k in range(e):
            W[i, k] /= L[i, i]
            change[k] += W[i, k] * y[i]
        for k in range(e):
            if W[i, k] != 0.0:  # measurements that are not used have rows of zeros
                for c in range(e):
                    P[k, c] -= W[i, k] * W[i, c]
