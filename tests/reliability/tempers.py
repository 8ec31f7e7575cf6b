"""Tempers of random problems: what their tuples cost, from ordinary numbers to those at the borders of doubles."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Temper = Callable[[np.random.Generator, Ints, Ints], Floats]


def _normal(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return rng.normal(-2.0, 4.0, len(tuples))


def _positive(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return rng.uniform(0.0, 10.0, len(tuples))


def _negative(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return rng.uniform(-10.0, 0.0, len(tuples))


def _ties(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return rng.integers(-3, 3, len(tuples)).astype(float)


def _all_equal(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return np.full(len(tuples), float(rng.choice([-1.0, 0.0, 1.0, -0.1])))


def _near_ties(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    """Costs that differ by about as much as the tolerances."""
    return -1.0 + rng.integers(0, 5, len(tuples)) * float(rng.choice([1e-6, 1e-8, 1e-9, 1e-10, 1e-15]))


def _scaled(factor: float) -> Temper:
    return lambda rng, tuples, sizes: factor * rng.normal(-0.5, 1.0, len(tuples))


def _wide(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return rng.choice([-1.0, 1.0], len(tuples)) * 10.0 ** rng.uniform(-12.0, 12.0, len(tuples))


def _prices(scale: float) -> Temper:
    """Prices of the measurements that nearly cancel, so that sums lose most of their digits."""

    def costs(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
        total = rng.normal(0.0, 1.0, len(tuples))
        for s, size in enumerate(sizes):
            price = np.concatenate([[0.0], rng.normal(0.0, scale, int(size))])
            price[1:] -= price[1:].mean() if size else 0.0
            total += price[tuples[:, s]]
        return total

    return costs


def _whole_at_the_border(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    """Whole numbers about where solvers stop treating them as such, and halves."""
    scale = float(rng.choice([1.0, 3e8, 1e9, 4e15, 9e15]))
    return rng.integers(-3, 3, len(tuples)) * scale + rng.integers(-2, 3, len(tuples)) * float(rng.choice([0.5, 1.0]))


def _dear_singletons(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    """Singletons so dear, or so cheap, that the tuples' own costs drown in them."""
    costs = rng.normal(0.0, 5.0, len(tuples))
    single = np.count_nonzero(tuples, axis=1) == 1
    return np.where(single, costs * float(rng.choice([-1e9, 1e6, 1e12])), costs)


def _large_gap(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    """Equal costs so large that the gap of the linear program dwarfs the differences that matter."""
    return -(10.0 ** rng.uniform(2.0, 8.0)) + rng.choice([0.0, 1.0]) * rng.normal(0.0, 1.0, len(tuples))


def _eighteen_decades(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return 10.0 ** rng.uniform(-9.0, 9.0, len(tuples))


def _forbidden(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return np.where(rng.random(len(tuples)) < 0.4, np.inf, rng.normal(-2.0, 4.0, len(tuples)))


def _zeros_of_both_signs(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return rng.choice([0.0, -0.0, 5e-324, -5e-324], len(tuples))


def _big_m(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    """Near ties, of which some are ruled out by costs of 1e9 to 1e299, all alike or each its own."""
    costs = rng.integers(-3, 4, len(tuples)) + rng.integers(0, 3, len(tuples)) * 10.0 ** -rng.integers(3, 16)
    costs *= 10.0 ** float(rng.choice([0.0, 0.0, 3.0, -14.0]))
    exponent = rng.uniform(9.0, 298.0, len(tuples) if rng.random() < 0.3 else 1)
    dear = rng.random(len(tuples)) < rng.choice([0.05, 0.3, 0.7])
    return np.where(dear, 10.0**exponent + costs, costs)


def _units_in_the_last_place(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    """Costs that differ in their last bits only."""
    base = float(rng.choice([1.0, -1.0, 0.1, -1 / 3, 1e6 + 1 / 7]))
    return base + rng.integers(-2, 3, len(tuples)) * np.spacing(base)


def _denormal(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return rng.integers(-9, 10, len(tuples)) * 5e-324 * float(rng.choice([1.0, 1e5, 1e15]))


def _thirds(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    """Each measurement a third, most tuples as dear as theirs together, less or more by a unit in the last place."""
    sums = np.count_nonzero(tuples, axis=1) / 3.0 * float(rng.choice([1.0, -1.0]))
    return sums + rng.integers(-1, 2, len(tuples)) * np.spacing(sums)


def _beside_nothing(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    return rng.choice([-1e-12, 1e-12, 0.0, 0.5, -0.5, 1.0], len(tuples))


def _huge_and_small(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    """Costs of 1e15 and of about 1 in one problem."""
    size = float(rng.choice([1e15, 1e16, 1e20])) * rng.choice([1.0, -1.0], len(tuples))
    return np.where(rng.random(len(tuples)) < rng.choice([0.1, 0.5, 0.9]), size, 0.0) + rng.normal(
        0.0, 1.0, len(tuples)
    )


def _powers_of_two(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    """Powers of two: all sums differ, and are exact as long as they have 53 digits."""
    signs = rng.choice([1.0, -1.0], len(tuples)) if rng.random() < 0.5 else -1.0
    return np.asarray(signs * 2.0 ** rng.permutation(len(tuples)).clip(max=900))


def _mixed(rng: np.random.Generator, tuples: Ints, sizes: Ints) -> Floats:
    """Costs of three tempers in one problem."""
    names = rng.choice([name for name in TEMPERS if name != "mixed"], 3)
    kinds = np.stack([TEMPERS[name](rng, tuples, sizes) for name in names])
    return kinds[rng.integers(0, 3, len(tuples)), np.arange(len(tuples))]


TEMPERS: dict[str, Temper] = {
    "normal": _normal,
    "positive": _positive,
    "negative": _negative,
    "ties": _ties,
    "all equal": _all_equal,
    "near ties": _near_ties,
    "1e-12": _scaled(1e-12),
    "1e-300": _scaled(1e-300),
    "1e4": _scaled(1e4),
    "1e12": _scaled(1e12),
    "1e290": _scaled(1e290),
    "wide": _wide,
    "prices 1e3": _prices(1e3),
    "prices 1e6": _prices(1e6),
    "prices 1e12": _prices(1e12),
    "whole": _whole_at_the_border,
    "dear singletons": _dear_singletons,
    "large gap": _large_gap,
    "18 decades": _eighteen_decades,
    "forbidden": _forbidden,
    "zeros": _zeros_of_both_signs,
    "big M": _big_m,
    "1 ulp": _units_in_the_last_place,
    "denormal": _denormal,
    "thirds": _thirds,
    "beside nothing": _beside_nothing,
    "huge and small": _huge_and_small,
    "powers of two": _powers_of_two,
    "mixed": _mixed,
}
