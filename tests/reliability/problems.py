"""Random problems in every shape and temper, small enough for an exact oracle; the same seed, the same problem.

A case is drawn as a *structure* (which tuples there are) and a *temper* (what they cost); both are drawn at
random by `draw`, or one after the other by whoever wants them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assoc.problem import AssignmentProblem

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

# the oracle below visits sets of covered measurements: 14 must-cover measurements are quick, 20 are not
_MOST_ROWS = 14


@dataclass(frozen=True)
class Case:
    """A problem and how it came about."""

    problem: AssignmentProblem
    structure: str
    temper: str
    number: int


def draw(seed: int, number: int, structures: Sequence[str] = (), tempers: Sequence[str] = ()) -> Case:
    """Draw case ``number`` of a seed, of some structures and tempers or of all."""
    rng = np.random.default_rng([seed, number])
    structure = str(rng.choice(list(structures or STRUCTURES)))
    temper = str(rng.choice(list(tempers or TEMPERS)))
    return Case(make(rng, structure, temper), structure, temper, number)


def make(rng: np.random.Generator, structure: str, temper: str) -> AssignmentProblem:
    """Draw a problem of one structure and temper."""
    tuples, sizes, dummy = STRUCTURES[structure](rng)
    costs = TEMPERS[temper](rng, tuples, sizes)
    order = rng.permutation(len(tuples))
    return AssignmentProblem(tuples[order], costs[order], sizes, dummy=dummy)


# --- structures: which tuples there are -------------------------------------------------------------------


def _grid(sizes: Ints, first: int) -> Ints:
    axes = [np.arange(first, n + 1) for n in sizes]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(sizes)).astype(np.int64)


def _sizes(rng: np.random.Generator, sensors: int, least: int = 0, rows: int = _MOST_ROWS) -> Ints:
    most = {1: 8, 2: 6, 3: 4, 4: 3, 5: 3, 6: 2}[sensors]
    while True:
        sizes = rng.integers(least, most + 1, sensors)
        if sizes.sum() <= rows:
            return sizes.astype(np.int64)


def _real(tuples: Ints) -> Ints:
    return tuples[np.count_nonzero(tuples, axis=1) >= 2]


Structure = tuple[Ints, Ints, bool]


def _gated(rng: np.random.Generator) -> Structure:
    sizes = _sizes(rng, int(rng.integers(2, 7)))
    tuples = _real(_grid(sizes, 0))
    return tuples[rng.random(len(tuples)) < rng.choice([0.05, 0.2, 0.5, 1.0])], sizes, True


def _with_listed_singletons(rng: np.random.Generator) -> Structure:
    tuples, sizes, dummy = _gated(rng)
    every = _grid(sizes, 0)
    single = every[np.count_nonzero(every, axis=1) == 1]
    return np.concatenate([tuples, single[rng.random(len(single)) < 0.7]]), sizes, dummy


def _with_duplicates(rng: np.random.Generator) -> Structure:
    tuples, sizes, dummy = _with_listed_singletons(rng)
    return np.concatenate([tuples, tuples[rng.random(len(tuples)) < 0.5]]), sizes, dummy


def _all_gated(rng: np.random.Generator) -> Structure:
    sizes = _sizes(rng, int(rng.integers(1, 7)))
    return np.zeros((0, len(sizes)), np.int64), sizes, True


def _one_sensor(rng: np.random.Generator) -> Structure:
    sizes = _sizes(rng, 1)
    return _grid(sizes, 1)[rng.random(int(sizes[0])) < 0.6], sizes, bool(rng.random() < 0.8)


def _one_measurement_each(rng: np.random.Generator) -> Structure:
    sizes = np.ones(int(rng.integers(2, 7)), np.int64)
    tuples = _real(_grid(sizes, 0))
    return tuples[rng.random(len(tuples)) < 0.6], sizes, True


def _empty_sensors(rng: np.random.Generator) -> Structure:
    sizes = _sizes(rng, int(rng.integers(2, 7)))
    sizes[rng.random(len(sizes)) < 0.5] = 0
    return _real(_grid(sizes, 0)), sizes, True


def _disconnected(rng: np.random.Generator) -> Structure:
    sensors = int(rng.integers(2, 5))
    start = np.zeros(sensors, np.int64)
    blocks = []
    for _ in range(3):
        sizes = rng.integers(0, 2 if sensors > 3 else 3, sensors)
        if (start + sizes).sum() > _MOST_ROWS:
            break
        block = _real(_grid(sizes, 0))
        blocks.append(np.where(block > 0, block + start, 0))
        start += sizes
    tuples = np.concatenate(blocks)
    number = [np.concatenate([[0], rng.permutation(n) + 1]) for n in start]
    return np.stack([number[s][tuples[:, s]] for s in range(sensors)], axis=1), start, True


def _chain(rng: np.random.Generator) -> Structure:
    """Draw one long component: each tuple shares a measurement with the next, as ghosts of bearings do."""
    length = int(rng.integers(3, 5))
    sizes = np.full(3, length, np.int64)
    steps = rng.integers(0, 2, (2 * length, 3))
    tuples = np.minimum(1 + np.cumsum(steps, axis=0), length)
    extra = _grid(sizes, 0)[rng.integers(0, (length + 1) ** 3, 10)]
    return _real(np.unique(np.concatenate([tuples, extra]), axis=0)), sizes, True


def _odd_cycle(rng: np.random.Generator) -> Structure:
    """Draw a cycle of pairs through an odd number of sensors: the linear program takes half of each."""
    length = int(rng.choice([3, 5, 7]))
    tuples = np.zeros((length, length), np.int64)
    for i in range(length):
        tuples[i, [i, (i + 1) % length]] = 1
    return tuples, np.ones(length, np.int64), True


def _axial_square(rng: np.random.Generator) -> Structure:
    sensors = int(rng.integers(2, 6))
    sizes = np.full(sensors, int(rng.integers(1, {2: 7, 3: 5, 4: 4, 5: 3}[sensors])), np.int64)
    return _grid(sizes, 1), sizes, False


def _axial_rectangular(rng: np.random.Generator) -> Structure:
    sizes = _sizes(rng, int(rng.integers(2, 6)), least=1, rows=12)
    return _grid(sizes, 1), sizes, False


def _axial_sparse(rng: np.random.Generator) -> Structure:
    tuples, sizes, dummy = (_axial_square, _axial_rectangular)[rng.integers(2)](rng)
    return tuples[rng.random(len(tuples)) < rng.choice([0.3, 0.6])], sizes, dummy


def _axial_without_anything(rng: np.random.Generator) -> Structure:
    sizes = rng.integers(0, 2, int(rng.integers(2, 5))).astype(np.int64)
    return np.zeros((0, len(sizes)), np.int64), sizes, False


def _star(rng: np.random.Generator) -> Structure:
    """Draw tuples that all hold the same measurement, or one of two."""
    sensors = int(rng.integers(3, 9))
    sizes = np.concatenate([[int(rng.integers(1, 3))], rng.integers(1, 3, sensors - 1)]).astype(np.int64)
    rays = rng.integers(0, sizes[1:] + 1, (int(rng.integers(3, 40)), sensors - 1))
    tuples = np.column_stack([rng.integers(1, sizes[0] + 1, len(rays)), rays])
    return _real(np.unique(tuples, axis=0)), sizes, True


def _uneven(rng: np.random.Generator) -> Structure:
    """Draw sensors of which one has nearly all measurements."""
    sensors = int(rng.integers(2, 5))
    sizes = np.ones(sensors, np.int64)
    sizes[rng.integers(sensors)] = rng.integers(6, _MOST_ROWS - sensors + 2)
    tuples = _real(_grid(sizes, 0))
    return tuples[rng.random(len(tuples)) < rng.choice([0.3, 1.0])], sizes, True


def _many_sensors(rng: np.random.Generator) -> Structure:
    sensors = int(rng.integers(7, 9))
    sizes = rng.integers(1, 3, sensors).astype(np.int64)
    sizes[np.flatnonzero(sizes == 2)[_MOST_ROWS - sensors :]] = 1
    tuples = rng.integers(0, sizes + 1, (int(rng.integers(10, 60)), sensors))
    return _real(np.unique(tuples, axis=0)), sizes, True


def _many_parts(rng: np.random.Generator) -> Structure:
    return many_parts(rng, int(10 ** rng.uniform(0.5, 1.6)))


def many_parts(rng: np.random.Generator, count: int) -> Structure:
    """Draw one hard part beside so many that are pairs, or a few tuples."""
    hard, sizes, _ = _chain(rng)
    blocks, start = [hard], sizes.copy()
    for own in rng.integers(0, 3, (count, len(sizes))):
        block = _real(_grid(own, 0))
        block = block[rng.random(len(block)) < 0.5]
        blocks.append(np.where(block > 0, block + start, 0))
        start += own
    return np.concatenate(blocks), start, True


def _nine_sensors_and_more(rng: np.random.Generator) -> Structure:
    sensors = int(rng.integers(9, 15))
    sizes = np.ones(sensors, np.int64)
    sizes[rng.permutation(sensors)[: _MOST_ROWS - sensors]] = 2
    tuples = rng.integers(0, sizes + 1, (int(rng.integers(10, 60)), sensors))
    tuples[rng.random(tuples.shape) < rng.choice([0.0, 0.5, 0.7])] = 0
    return _real(np.unique(tuples, axis=0)), sizes, True


def _nine_sensors_axial(rng: np.random.Generator) -> Structure:
    """Draw tuples over sensors of two or three measurements each; for each the one that begins with its complement."""
    sizes = rng.integers(2, 4, int(rng.integers(9, 15)))
    tuples = rng.integers(1, 3, (int(rng.integers(2, 20)), len(sizes)))
    return np.unique(np.concatenate([tuples, 3 - tuples]), axis=0), sizes, False


def _long_lists(rng: np.random.Generator) -> Structure:
    """Draw two to five lists of together at most 12, one much longer than the others, few or all tuples."""
    sensors = int(rng.integers(2, 6))
    sizes = rng.integers(0, 3, sensors)
    sizes[0] = rng.integers(0, 13 - sizes[1:].sum())
    every = _grid(rng.permutation(sizes), 0)
    kept = every[every.any(axis=1) & (rng.random(len(every)) < rng.choice([0.02, 0.1, 0.4]))]
    return kept, every.max(axis=0), True


def _nested(rng: np.random.Generator) -> Structure:
    """Draw tuples each of which is the one before without a measurement, down to single ones."""
    sensors = int(rng.integers(2, 6))
    chains = rng.integers(1, 4, (int(rng.integers(1, 5)), sensors))
    rows = []
    for chain in chains:
        for s in rng.permutation(sensors):
            rows.append(chain.copy())
            chain[s] = 0
    return np.unique(rows, axis=0), chains.max(axis=0, initial=0) + 3, True


def _forced(rng: np.random.Generator) -> Structure:
    """Draw an axial problem with one cover and some tuples more, of which none, or all but one, may fit anywhere."""
    sensors, size = int(rng.integers(2, 6)), int(rng.integers(1, 5))
    only = np.stack([rng.permutation(size) + 1 for _ in range(sensors)], axis=1)
    more = rng.integers(1, size + 1, (int(rng.integers(0, 5)), sensors))
    # measurements that are in one tuple only force it
    more[:, 0] = np.minimum(more[:, 0], max(size - 2, 1))
    return np.unique(np.concatenate([only, more]), axis=0), np.full(sensors, size), False


def _pairs_only(rng: np.random.Generator) -> Structure:
    """Draw pairs between three to five lists: odd cycles of all lengths, half of each tuple in the linear program."""
    sizes = rng.integers(1, 4, int(rng.integers(3, 6)))
    pairs = _grid(sizes, 0)
    pairs = pairs[np.count_nonzero(pairs, axis=1) == 2]
    return pairs[rng.random(len(pairs)) < rng.choice([0.2, 0.6])], sizes, True


STRUCTURES: dict[str, Callable[[np.random.Generator], Structure]] = {
    "gated": _gated,
    "listed singletons": _with_listed_singletons,
    "duplicates": _with_duplicates,
    "all gated": _all_gated,
    "one sensor": _one_sensor,
    "one measurement each": _one_measurement_each,
    "empty sensors": _empty_sensors,
    "disconnected": _disconnected,
    "chain": _chain,
    "odd cycle": _odd_cycle,
    "axial square": _axial_square,
    "axial rectangular": _axial_rectangular,
    "axial sparse": _axial_sparse,
    "axial, nothing": _axial_without_anything,
    "star": _star,
    "uneven": _uneven,
    "many sensors": _many_sensors,
    "many parts": _many_parts,
    "9 to 14 sensors": _nine_sensors_and_more,
    "9 to 14 sensors, axial": _nine_sensors_axial,
    "long lists": _long_lists,
    "nested": _nested,
    "forced": _forced,
    "pairs only": _pairs_only,
}


# --- tempers: what the tuples cost ------------------------------------------------------------------------

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
