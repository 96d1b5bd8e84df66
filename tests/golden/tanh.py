"""Fits the rational function of `canter_gait::tanh` and prints its coefficients and its error.

Iteratively reweighted linear least squares on tanh(x) Q(x^2) = x P(x^2), degrees 4 and 4 in x^2, over [0, 9].
Needs numpy.
"""

import numpy as np

LIMIT, DEGREE, POINTS, ROUNDS = 9.0, 4, 4000, 60


def horner(coefficients, s):
    total = np.full_like(s, coefficients[-1])
    for c in coefficients[-2::-1]:
        total = total * s + c
    return total


def fit():
    x = LIMIT / 2 * (1 - np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS))
    s, target = (x / LIMIT) ** 2, np.tanh(x)
    error_weight, denominator, best = np.ones_like(x), np.ones_like(x), None
    for _ in range(ROUNDS):
        columns = [x * s**i for i in range(DEGREE + 1)] + [-target * s**i for i in range(1, DEGREE + 1)]
        row_weight = np.sqrt(error_weight) / denominator
        solution, *_ = np.linalg.lstsq(np.stack(columns, 1) * row_weight[:, None], target * row_weight, rcond=None)
        p, q = solution[: DEGREE + 1], np.r_[1.0, solution[DEGREE + 1 :]]
        denominator = horner(q, s)
        error = np.abs(x * horner(p, s) / denominator - target)
        if best is None or error.max() < best[0]:
            scale = LIMIT ** (2 * np.arange(DEGREE + 1))
            best = error.max(), p / scale, q / scale
        error_weight = error_weight * (error / error.max() + 1e-3)
        error_weight /= error_weight.mean()
    return best


error, p, q = fit()
x = np.linspace(-LIMIT, LIMIT, 400001).astype(np.float32)
s = x * x
single = np.clip(x * horner(p.astype(np.float32), s) / horner(q.astype(np.float32), s), -1, 1)
print("P", [f"{c:.9e}" for c in p])
print("Q", [f"{c:.9e}" for c in q])
print(f"largest error: {error:.2e} in double, {np.abs(single - np.tanh(x.astype(float))).max():.2e} in single precision")
