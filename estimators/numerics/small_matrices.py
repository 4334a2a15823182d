"""Small dense matrices in kernels, written out: of those of a filter most entries are zero, and a
library call costs more than the product.

In      arrays of a kernel's row; the last argument is filled
Limits  a kernel copies whole arrays by `put` only: numba takes seconds to translate an assignment
        to a slice
"""

import math

import numpy as np

from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.typing import Array

SINGULAR = 1e-12  # of a diagonal entry: what is left of it below that is rounding


@inlined
def clear(M: Array) -> None:
    """All entries zero."""
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            M[i, j] = 0.0


@inlined
def put(A: Array, to: Array) -> None:
    """A matrix, or an array of rows, into another of its shape."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            to[i, j] = A[i, j]


@inlined
def block(scale: float, B: Array, row: int, column: int, M: Array) -> None:
    """scale B with its first entry at a place in M."""
    for i in range(B.shape[0]):
        for j in range(B.shape[1]):
            M[row + i, column + j] = scale * B[i, j]


@inlined
def product(A: Array, B: Array, AB: Array) -> None:
    """A B of matrices of any size."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            AB[i, j] = 0.0
        for k in range(A.shape[1]):
            if A[i, k] != 0.0:
                for j in range(B.shape[1]):
                    AB[i, j] += A[i, k] * B[k, j]


@inlined
def spread(A: Array, P: Array, APA: Array) -> None:
    """A P A' of a symmetric P; A of fewer columns sees only the first of P."""
    AP = np.zeros(A.shape)
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            if A[i, k] != 0.0:
                for j in range(A.shape[1]):
                    AP[i, j] += A[i, k] * P[k, j]
        for j in range(i + 1):
            total = 0.0
            for k in range(A.shape[1]):
                if A[j, k] != 0.0:
                    total += AP[i, k] * A[j, k]
            APA[i, j], APA[j, i] = total, total


@inlined
def variance_of(h: Array, P: Array) -> float:
    """h P h'."""
    total = 0.0
    for i in range(len(h)):
        if h[i] != 0.0:
            for j in range(len(h)):
                total += h[i] * P[i, j] * h[j]
    return total


@inlined
def rigid_acceleration(w: Array, change: Array, A: Array) -> None:
    """Acceleration (3, 3) of a point of a rigid body by its place: [dw]x + [w]x [w]x, of rates and of their derivative."""
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    for i in range(3):
        for j in range(3):
            A[i, j] = w[i] * w[j]
        A[i, i] -= square
    A[0, 1] -= change[2]
    A[1, 0] += change[2]
    A[0, 2] += change[1]
    A[2, 0] -= change[1]
    A[1, 2] -= change[0]
    A[2, 1] += change[0]


@inlined
def cholesky(S: Array, L: Array) -> bool:
    """L of S = L L', the upper half with zeros; no where S is not positive definite."""
    for i in range(len(S)):
        for j in range(i + 1):
            s = S[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i > j:
                L[i, j], L[j, i] = s / L[j, j], 0.0
            elif s > SINGULAR * S[i, i]:
                L[i, i] = math.sqrt(s)
            else:
                return False
    return True


@inlined
def solve_lower(L: Array, B: Array) -> None:
    """L^-1 B in place, of a lower triangular L."""
    for i in range(len(L)):
        for k in range(i):
            for j in range(B.shape[1]):
                B[i, j] -= L[i, k] * B[k, j]
        for j in range(B.shape[1]):
            B[i, j] /= L[i, i]


@inlined
def solve_upper(L: Array, B: Array) -> None:
    """L'^-1 B in place."""
    for i in range(len(L) - 1, -1, -1):
        for k in range(i + 1, len(L)):
            for j in range(B.shape[1]):
                B[i, j] -= L[k, i] * B[k, j]
        for j in range(B.shape[1]):
            B[i, j] /= L[i, i]
