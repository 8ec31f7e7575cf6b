"""Small symmetric matrices in kernels: Cholesky factors and solutions."""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import lean_inner_njit, literal_njit, njit
from assoc._types import Array


@literal_njit
def factor(A: Array, n: int, L: Array) -> bool:
    """Write the lower Cholesky factor of A[:n, :n] into L; False where A is not positive definite."""
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                # NaN must fail as well
                if not (total > 0.0 and total < math.inf):
                    return False
                L[i, i] = math.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    return True


@lean_inner_njit
def solve_in_place(L: Array, n: int, b: Array) -> None:
    """Replace b (n,) by the solution of L L' x = b."""
    for i in range(n):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]


@njit
def all_factors(A: Array) -> tuple[int, Array]:
    """Cholesky factors (B, n, n) of a stack; the first number is the first that has none, or -1."""
    L = np.zeros(A.shape)
    for b in range(len(A)):
        if not factor(A[b], A.shape[1], L[b]):
            return b, L
    return -1, L
