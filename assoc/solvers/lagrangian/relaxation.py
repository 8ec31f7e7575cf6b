"""The two halves of the Lagrangian method: down to a 2-D assignment, and up again sensor by sensor."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import njit
from assoc._types import Floats
from assoc.packing.kernels.matching import match_sparse
from assoc.packing.neighbourhoods.cover import chosen_columns
from assoc.packing.packing import Packing


class Relaxation:
    """A packing, its sensors in the order of relaxation and its columns grouped by their first two.

    Sensors whose measurements must all be used come first, so that the 2-D problem keeps what is hardest.

    Parameters
    ----------
    packing : Packing
        The problem.
    """

    def __init__(self, packing: Packing) -> None:
        self.packing = packing
        self.cols, self.sensor, self.by_pair, self.group_start = _arrange(packing.cols, packing.slack)

    def solve(self, duals: Floats) -> tuple[Floats, Floats] | None:
        """Solve the relaxation for the multipliers of sensors 3..S in ``duals``.

        Returns
        -------
        (float array, float array) or None
            Feasible multipliers of all rows, whose sum is the value of the relaxation, and the subgradient
            (0 for the rows of the first two sensors). None where there is no 2-D assignment.
        """
        result = duals.copy()
        subgradient = np.zeros(duals.size)
        feasible = _relax(
            self.cols,
            self.packing.weights,
            self.packing.slack,
            self.sensor,
            self.by_pair,
            self.group_start,
            result,
            subgradient,
        )
        return (result, subgradient) if feasible else None

    def recover(self, duals: Floats) -> NDArray[np.int64] | None:
        """Return a feasible choice of columns built up sensor by sensor, None where that met a dead end."""
        owner = np.full(duals.size, -1, dtype=np.int64)
        if self.cols.shape[1] == 1:
            # with one sensor there is nothing to assign upward: each row takes its cheapest column
            order = np.argsort(-self.packing.weights, kind="stable")
            owner[self.cols[order, 0]] = order
        elif not _recover(self.cols, self.packing.weights, self.packing.slack, self.sensor, duals, owner):
            return None
        chosen: NDArray[np.int64] = chosen_columns(self.cols, owner)
        return chosen


@njit
def _arrange(cols: Any, slack: Any) -> Any:
    """Columns with the sensors in order of relaxation, the sensor of each row, and the columns by pair.

    The columns of each group share their rows of the first two sensors; groups come in order of the first row.
    """
    num, num_sensors = cols.shape
    num_rows = slack.size
    sensor = np.zeros(num_rows, np.int64)
    for j in range(num):
        for s in range(num_sensors):
            if cols[j, s] >= 0:
                sensor[cols[j, s]] = s
    must = np.zeros(num_sensors, np.bool_)
    for r in range(num_rows):
        if not slack[r]:
            must[sensor[r]] = True
    place = np.empty(num_sensors, np.int64)
    count = 0
    for wanted in (True, False):
        for s in range(num_sensors):
            if must[s] == wanted:
                place[s] = count
                count += 1
    ordered = np.empty_like(cols)
    for j in range(num):
        for s in range(num_sensors):
            ordered[j, place[s]] = cols[j, s]
    for r in range(num_rows):
        sensor[r] = place[sensor[r]]
    # sorted by counting, by the second row and then by the first
    by_pair, other = np.arange(num), np.empty(num, np.int64)
    for s in range(min(num_sensors, 2) - 1, -1, -1):
        start = np.zeros(num_rows + 2, np.int64)
        for j in range(num):
            start[ordered[j, s] + 2] += 1
        for r in range(num_rows + 1):
            start[r + 1] += start[r]
        for j in by_pair:
            other[start[ordered[j, s] + 1]] = j
            start[ordered[j, s] + 1] += 1
        by_pair, other = other, by_pair
    group_start = np.empty(num + 1, np.int64)
    count = 0
    for k in range(num):
        same = k > 0
        for s in range(min(num_sensors, 2)):
            same = same and ordered[by_pair[k], s] == ordered[by_pair[k - 1], s]
        if not same:
            group_start[count] = k
            count += 1
    group_start[count] = num
    return ordered, sensor, by_pair, group_start[: count + 1].copy()


@njit
def _priced(cols: Any, weights: Floats, duals: Floats, j: int, first: int) -> float:
    """Weight of a column less the multipliers of its rows in sensors from ``first`` on."""
    value = weights[j]
    for s in range(first, cols.shape[1]):
        if cols[j, s] >= 0:
            value -= duals[cols[j, s]]
    return value


@njit
def _number(sensor: Any, which: int, local: Any, rows: Any) -> int:
    """Number the rows of one sensor."""
    count = 0
    for r in range(sensor.size):
        if sensor[r] == which:
            local[r] = count
            rows[count] = r
            count += 1
    return count


@njit
def _slack_prices(rows: Any, num: int, slack: Any) -> Floats:
    prices = np.zeros(num)
    for i in range(num):
        if not slack[rows[i]]:
            prices[i] = np.inf
    return prices


@njit
def _square(left: Floats, right: Floats) -> None:
    """Where all on the left must be matched and both sides are as long, the right needs no price."""
    if left.size == right.size and (left.size == 0 or left.min() == np.inf):
        right[:] = 0.0


@njit
def _relax(
    cols: Any, weights: Floats, slack: Any, sensor: Any, by_pair: Any, group_start: Any, duals: Any, subgradient: Any
) -> bool:  # fmt: skip
    num_rows, num_sensors = duals.size, cols.shape[1]
    # columns of the relaxed sensors alone belong to no pair: their multipliers are lowered until none pays
    for g in range(group_start.size - 1):
        j = by_pair[group_start[g]]
        if cols[j, 0] < 0 and (num_sensors < 2 or cols[j, 1] < 0):
            for t in range(group_start[g], group_start[g + 1]):
                k = by_pair[t]
                value = _priced(cols, weights, duals, k, 2)
                if value < 0.0:
                    for s in range(2, num_sensors):
                        if cols[k, s] >= 0:
                            duals[cols[k, s]] += value
                            break
    local = np.empty(num_rows, np.int64)
    left_rows, right_rows = np.empty(num_rows, np.int64), np.empty(num_rows, np.int64)
    num_left = _number(sensor, 0, local, left_rows)
    num_right = _number(sensor, 1, local, right_rows)
    left_alone = _slack_prices(left_rows, num_left, slack)
    right_alone = _slack_prices(right_rows, num_right, slack)
    left_column, right_column = np.full(num_left, -1, np.int64), np.full(num_right, -1, np.int64)
    indptr = np.zeros(num_left + 1, np.int64)
    capacity = group_start.size
    indices, column, costs = np.empty(capacity, np.int64), np.empty(capacity, np.int64), np.empty(capacity)
    count = 0
    at = 0
    for g in range(group_start.size - 1):
        j = by_pair[group_start[g]]
        left = cols[j, 0]
        right = cols[j, 1] if num_sensors > 1 else -1
        if left < 0 and right < 0:
            continue
        least, best = np.inf, -1
        for t in range(group_start[g], group_start[g + 1]):
            value = _priced(cols, weights, duals, by_pair[t], 2)
            if value < least:
                least, best = value, by_pair[t]
        if right < 0:
            if least < left_alone[local[left]]:
                left_alone[local[left]] = least
                left_column[local[left]] = best
        elif left < 0:
            if least < right_alone[local[right]]:
                right_alone[local[right]] = least
                right_column[local[right]] = best
        else:
            # groups come in order of the left row
            while at < local[left]:
                at += 1
                indptr[at] = count
            indices[count] = local[right]
            column[count] = best
            costs[count] = least
            count += 1
    while at < num_left:
        at += 1
        indptr[at] = count
    _square(left_alone, right_alone)
    row_edge = np.empty(num_left, np.int64)
    u, v = np.empty(num_left), np.empty(num_right)
    if match_sparse(indptr, indices[:count], costs[:count], left_alone, right_alone, row_edge, u, v) == np.inf:
        return False
    for r in range(num_rows):
        subgradient[r] = 1.0 if sensor[r] >= 2 else 0.0
    taken = np.zeros(num_right, np.bool_)
    for i in range(num_left):
        duals[left_rows[i]] = u[i]
        e = row_edge[i]
        if e >= 0:
            taken[indices[e]] = True
        j = column[e] if e >= 0 else left_column[i]
        if j >= 0:
            _use(cols, j, subgradient)
    for i in range(num_right):
        duals[right_rows[i]] = v[i]
        if not taken[i] and right_column[i] >= 0:
            _use(cols, right_column[i], subgradient)
    return True


@njit
def _use(cols: Any, j: int, subgradient: Any) -> None:
    for s in range(2, cols.shape[1]):
        if cols[j, s] >= 0:
            subgradient[cols[j, s]] -= 1.0


@njit
def _prefix(cols: Any, j: int, stop: int, part: Any, size: Any) -> int:
    """Which partial tuple column j continues: -1 none (it has no row so far), -2 it does not fit."""
    found = -1
    members = 0
    for s in range(stop):
        r = cols[j, s]
        if r >= 0:
            if found >= 0 and part[r] != found:
                return -2
            found = part[r]
            members += 1
    if found >= 0 and members != size[found]:
        return -2
    return found


@njit
def _recover(cols: Any, weights: Floats, slack: Any, sensor: Any, duals: Floats, owner: Any) -> bool:
    """Assign the tuples so far to the next sensor, from the second to the last."""
    num_rows, num_sensors = duals.size, cols.shape[1]
    num_columns = weights.size
    part = np.full(num_rows, -1, np.int64)
    size = np.zeros(num_rows, np.int64)
    local = np.empty(num_rows, np.int64)
    rows = np.empty(num_rows, np.int64)
    must = np.zeros(num_rows, np.bool_)
    num_parts = _number(sensor, 0, local, rows)
    for i in range(num_parts):
        part[rows[i]] = i
        size[i] = 1
        must[i] = not slack[rows[i]]
    left = np.empty(num_columns, np.int64)
    right = np.empty(num_columns, np.int64)
    price = np.empty(num_columns)
    for level in range(1, num_sensors):
        num_right = _number(sensor, level, local, rows)
        last = level == num_sensors - 1
        left_alone = np.zeros(num_parts)
        for p in range(num_parts):
            if must[p]:
                left_alone[p] = np.inf
        right_alone = _slack_prices(rows, num_right, slack)
        left_column, right_column = np.full(num_parts, -1, np.int64), np.full(num_right, -1, np.int64)
        indptr = np.zeros(num_parts + 1, np.int64)
        for j in range(num_columns):
            p = _prefix(cols, j, level, part, size)
            q = cols[j, level]
            left[j] = -1
            if p == -2 or (p < 0 and q < 0):
                continue
            value = _priced(cols, weights, duals, j, level + 1)
            if q < 0:
                if value < left_alone[p]:
                    left_alone[p] = value
                    left_column[p] = j
            elif p < 0:
                if value < right_alone[local[q]]:
                    right_alone[local[q]] = value
                    right_column[local[q]] = j
            else:
                left[j] = p
                right[j] = local[q]
                price[j] = value
                indptr[p + 1] += 1
        for p in range(num_parts):
            indptr[p + 1] += indptr[p]
        count = indptr[num_parts]
        indices, column, costs = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count)
        fill = indptr[:-1].copy()
        for j in range(num_columns):
            if left[j] >= 0:
                e = fill[left[j]]
                fill[left[j]] += 1
                indices[e] = right[j]
                column[e] = j
                costs[e] = price[j]
        _square(left_alone, right_alone)
        row_edge = np.empty(num_parts, np.int64)
        u, v = np.empty(num_parts), np.empty(num_right)
        if match_sparse(indptr, indices, costs, left_alone, right_alone, row_edge, u, v) == np.inf:
            return False
        if last:
            taken = np.zeros(num_right, np.bool_)
            for p in range(num_parts):
                e = row_edge[p]
                if e >= 0:
                    taken[indices[e]] = True
                _put(cols, owner, column[e] if e >= 0 else left_column[p])
            for i in range(num_right):
                if not taken[i]:
                    _put(cols, owner, right_column[i])
            return True
        # new partial tuples; a part left alone that no column continues is broken up into its rows
        before = part.copy()
        before_size = size[:num_parts].copy()
        partner = np.full(num_parts, -1, np.int64)
        keep = np.zeros(num_parts, np.bool_)
        number = np.full(num_parts, -1, np.int64)
        for p in range(num_parts):
            e = row_edge[p]
            if e >= 0:
                partner[p] = indices[e]
            keep[p] = e >= 0 or left_column[p] >= 0 or before_size[p] == 1
        next_part = 0
        of_right = np.full(num_right, -1, np.int64)
        for p in range(num_parts):
            if keep[p]:
                number[p] = next_part
                size[next_part] = before_size[p]
                if partner[p] >= 0:
                    of_right[partner[p]] = next_part
                    size[next_part] += 1
                next_part += 1
        for r in range(num_rows):
            if sensor[r] < level:
                p = before[r]
                if number[p] >= 0:
                    part[r] = number[p]
                else:
                    part[r] = next_part
                    size[next_part] = 1
                    next_part += 1
        for i in range(num_right):
            if of_right[i] < 0:
                of_right[i] = next_part
                size[next_part] = 1
                next_part += 1
            part[rows[i]] = of_right[i]
        num_parts = next_part
        for p in range(num_parts):
            must[p] = False
        for r in range(num_rows):
            if sensor[r] <= level and not slack[r]:
                must[part[r]] = True
    return True


@njit
def _put(cols: Any, owner: Any, j: int) -> None:
    if j >= 0:
        for s in range(cols.shape[1]):
            if cols[j, s] >= 0:
                owner[cols[j, s]] = j
