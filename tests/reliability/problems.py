"""Random problems in every shape and temper, small enough for an exact oracle; the same seed, the same problem.

A case is drawn as a *structure* (which tuples there are) and a *temper* (what they cost: tempers.py); both are drawn at
random by `draw`, or one after the other by whoever wants them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from assoc.problem import AssignmentProblem
from tests.reliability.tempers import TEMPERS, Ints

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
