"""Coefficients of a filter: those whose prediction is nearest to the true geometry in an l_p norm.

Source: Balan & Taubin 2000, eqs. (13) to (19), (22). Each coordinate is fitted by itself. The columns of eq.
(15) or (16) become an orthonormal basis Q with columns = Q R; every norm then works with Q, whose few shares
are well scaled whatever basis and degree were asked for, and a back substitution with R gives the
coefficients. Cost at degree d: O(n d^2) for l2; l-infinity and l1 solve a handful of linear programs over
some of the rows.

The term eps * sum(f_j + g_j) of the programs (18) and (22) is left out: it decides how a coefficient splits
into f_j - g_j, and the solver takes free variables, which do not split.

l2 coefficients are the same bits on every machine; those of the other norms depend on the linear program
solver, or on powers of floats, and may differ in their last bits between machines.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linprog

from meshtide_codec import core
from meshtide_codec.filters import (
    Basis,
    FilterSpec,
    basis_columns,
    coefficient_count,
    divide,
    is_safe_denominator,
    predict,
)
from meshtide_codec.graph import Adjacency, check_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

LARGEST_COEFFICIENT = 1e30  # beyond it the input is absurd, and the zeroth order filter is used
RELATIVE_GAP = 1e-7  # between a program over some rows and its value over all rows, where it counts as solved
MAXIMUM_ROUNDS = 200  # of row generation; a dozen are usual
ROWS_PER_ROUND = 64  # most violated rows that join the l-infinity program at a time
SMALLEST_BAND = 1000  # rows that the first l1 program holds at least
REWEIGHTING_ROUNDS = 60
PREPARING_ROUNDS = 12  # of reweighting before the l1 program
FIRST_FLOOR = 0.1  # residuals are kept away from 0 by this share of the largest one, halved in each round ...
LAST_FLOOR = 1e-6  # ... down to this
NEGLIGIBLE = 1e-10  # of the longest column: what is left of a column below this length is rounding noise
DENOMINATOR_SHRINKAGES = 7  # halvings of q_1, q_2, ... that are tried before the denominator is given up


def fit(
    adjacency: Adjacency,
    extension: NDArray[np.float64],
    target: NDArray[np.float64],
    spec: FilterSpec,
) -> NDArray[np.float32]:
    """The coefficients for `predict` that bring the filtered extension nearest to the target.

    Where columns depend on each other (planes, few vertices, no edges) the degree is lowered as far as
    necessary; what is left undetermined is as in the zeroth order filter.

    Args:
        adjacency: the vertex graph of the fine level.
        extension: (n, 3) float64.
        target: (n, 3) float64, the true geometry.
        spec: the filter and the norm.

    Returns:
        (3, coefficient_count(spec)) float32, one row per coordinate.

    Raises:
        MeshError: extension or target have another shape or type, or are not finite.

    >>> from meshtide_codec.graph import build_adjacency
    >>> adjacency = build_adjacency(np.array([[0, 1, 2], [0, 2, 3]], np.int32), 4)
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> fit(adjacency, square, 2 * square, FilterSpec("polynomial", degree=1)).tolist()
    [[2.0, 0.0], [2.0, 0.0], [1.0, 0.0]]
    """
    check_points(adjacency, extension, "extension")
    check_points(adjacency, target, "target")
    if coefficient_count(spec) == 0:
        return np.empty((3, 0), np.float32)
    if spec.kind == "rational":
        return _rational(adjacency, extension, target, spec)
    return np.stack([_polynomial(adjacency, extension[:, axis], target[:, axis], spec) for axis in range(3)])


def _polynomial(
    adjacency: Adjacency, values: NDArray[np.float64], target: NDArray[np.float64], spec: FilterSpec
) -> NDArray[np.float32]:
    """Coefficients of one coordinate: (13) solved as a correction of the zeroth order filter."""
    columns = basis_columns(adjacency, values, spec.degree, spec.basis)
    return _fitted(adjacency, columns, target - values, spec.norm)


def _fitted(
    adjacency: Adjacency, columns: NDArray[np.float64], residual: NDArray[np.float64], norm: float
) -> NDArray[np.float32]:
    """(1, 0, 0, ...) plus the shares of `columns` that bring `residual` nearest to 0; both arrays are used up."""
    isolated = adjacency.degree == 0  # no filter moves those
    columns[isolated] = 0.0
    residual[isolated] = 0.0
    triangle = np.zeros((columns.shape[1], columns.shape[1]))
    rank = _orthonormalise(columns, triangle)
    shares = _project(columns[:, :rank], residual)
    if norm != 2.0 and rank > 0 and residual.any():
        basis = columns[:, :rank]
        if norm == math.inf:
            shares = shares + _least_maximum(basis, residual, -shares)
        elif norm == 1.0:
            shares = shares + _least_sum(basis, residual)
        else:
            shares = shares + _reweighted(basis, residual, norm, REWEIGHTING_ROUNDS)
    return _rounded_back_substitution(triangle, shares)


def _dot(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Sum of products in a fixed order: fast, accurate, and the same bits everywhere."""
    return float(core.library().mt_dot(first, second, len(first)))


def _orthonormalise(columns: NDArray[np.float64], triangle: NDArray[np.float64]) -> int:
    """Replace `columns` (n, k), Fortran order, by an orthonormal Q with columns = Q triangle, as far as independent.

    Modified Gram-Schmidt, done twice ("twice is enough"), which stays orthogonal to rounding however alike the columns
    are. Returns how many leading columns are independent; the first one that is not ends the work.
    """
    count: int = columns.shape[1]
    longest = 0.0
    for column in range(count):
        current = columns[:, column]
        longest = max(longest, math.sqrt(_dot(current, current)))
        triangle[:column, column] = _project(columns[:, :column], current)
        length = math.sqrt(_dot(current, current))
        if not length > NEGLIGIBLE * longest:
            return column
        triangle[column, column] = length
        current /= length
    return count


def _project(columns: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Take from `values` (n,) its part along orthonormal columns (n, k); returns the (k,) shares."""
    shares = np.zeros(columns.shape[1])
    for _ in range(2):
        for column, along in enumerate(columns.T):
            share = _dot(along, values)
            shares[column] += share
            values -= share * along
    return shares


def _combine(columns: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum of shares[k] * columns[:, k], in order."""
    result = np.zeros(len(columns))
    for along, share in zip(columns.T, shares, strict=True):
        result += share * along
    return result


def _rounded_back_substitution(triangle: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float32]:
    """Solve R (c - e_0) = shares from the last coefficient to the first, rounding each before the next is found.

    So a coefficient makes up for the rounding of those of higher degree, which may be large and cancel each
    other; what is lost is half a unit in the last place of the orthogonal part of each column only. Plain
    floats, in a fixed order.
    """
    zeroth = np.zeros(len(triangle), np.float32)
    zeroth[0] = 1.0
    coefficients = zeroth.copy()
    for row in range(len(shares) - 1, -1, -1):
        remainder = float(shares[row])
        for column in range(row + 1, len(shares)):
            remainder -= float(triangle[row, column]) * float(coefficients[column])
        coefficient = remainder / float(triangle[row, row]) + float(zeroth[row])
        if not abs(coefficient) <= LARGEST_COEFFICIENT:
            return zeroth
        coefficients[row] = coefficient
    return coefficients


def _least_maximum(
    basis: NDArray[np.float64], residual: NDArray[np.float64], zeroth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Shares z with the least max |residual - Q z|: program (18) by row generation.

    The program over some rows bounds the whole one from below, its solution from above; the rows it violates
    most join until both meet. The solution is seldom the only one: where the zeroth order filter's shares,
    `zeroth`, are no worse, they are it.
    """
    unit = float(np.abs(residual).max())
    scale = math.sqrt(len(residual))  # makes the entries of Q about 1
    rank = basis.shape[1]
    best = zeroth
    best_maximum = float(np.abs(residual - _combine(basis, zeroth)).max())
    remaining = residual
    chosen = np.empty(0, np.int64)
    for _ in range(MAXIMUM_ROUNDS):
        chosen = np.union1d(chosen, _largest(np.abs(remaining), ROWS_PER_ROUND))
        rows, heights = basis[chosen] * scale, residual[chosen] / unit
        margin = np.ones((len(chosen), 1))
        solved: Any = linprog(
            np.append(np.zeros(rank), 1.0),
            A_ub=np.block([[rows, -margin], [-rows, -margin]]),
            b_ub=np.concatenate([heights, -heights]),
            bounds=[(None, None)] * rank + [(0.0, None)],
            method="highs-ds",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        if solved.status != 0:
            break
        shares = solved.x[:rank] * (scale * unit)
        remaining = residual - _combine(basis, shares)
        maximum = float(np.abs(remaining).max())
        if maximum < best_maximum - RELATIVE_GAP * unit:
            best, best_maximum = shares, maximum
        if best_maximum <= solved.fun * unit + 2 * RELATIVE_GAP * unit:
            break
    return best


def _least_sum(basis: NDArray[np.float64], residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares z with the least sum |residual - Q z|: program (22), over the rows whose sign is in doubt.

    Rows far from 0 keep their sign, so together they are one linear term (Portnoy & Koenker 1997). Rows that
    turn out to have changed sign join, until none has: then the solution is that of the whole program. It is
    found in the dual, which has one equation per coefficient and one variable in [-1, 1] per row. Never worse
    than z = 0.
    """
    unit = float(np.abs(residual).max())
    scale = math.sqrt(len(residual))
    best = _reweighted(basis, residual, 1.0, PREPARING_ROUNDS)
    remaining = residual - _combine(basis, best)
    best_sum = float(np.abs(remaining).sum())
    signs = np.where(remaining < 0.0, -1.0, 1.0)
    band_size = max(SMALLEST_BAND, int(len(residual) ** (2 / 3)))
    in_doubt = np.zeros(len(residual), np.bool_)
    in_doubt[_largest(-np.abs(remaining), band_size)] = True
    for _ in range(MAXIMUM_ROUNDS):
        settled = np.where(in_doubt, 0.0, signs)
        pull = np.array([_dot(column, settled) for column in basis.T])
        solved: Any = linprog(
            -residual[in_doubt] / unit,
            A_eq=basis[in_doubt].T * scale,
            b_eq=-pull * scale,
            bounds=(-1.0, 1.0),
            method="highs-ds",
        )
        if solved.status == 0:
            shares = -solved.eqlin.marginals * (scale * unit)
            remaining = residual - _combine(basis, shares)
            total = float(np.abs(remaining).sum())
            if total < best_sum:
                best, best_sum = shares, total
            doubtful = ~in_doubt & (signs * remaining < -RELATIVE_GAP * unit)
        else:  # the rows in doubt cannot balance the others: take more of them
            band_size *= 4
            doubtful = np.zeros(len(residual), np.bool_)
            doubtful[_largest(-np.abs(remaining), band_size)] = True
            doubtful &= ~in_doubt
        if not doubtful.any():
            break
        in_doubt |= doubtful
    return best


def _reweighted(
    basis: NDArray[np.float64], residual: NDArray[np.float64], norm: float, rounds: int
) -> NDArray[np.float64]:
    """Shares z with a small sum |residual - Q z|^p, 1 <= p < 2: least squares with weights |.|^(p-2), repeated.

    Residuals near 0 count as a floor, which falls from round to round. Never worse than z = 0.
    """
    unit = float(np.abs(residual).max())
    rank = basis.shape[1]
    matrix, vector = np.empty((rank, rank)), np.empty(rank)
    best, best_sum = np.zeros(rank), math.inf
    shares = best
    for turn in range(rounds):
        magnitudes = np.abs(residual - _combine(basis, shares)) / unit
        total = float((magnitudes**norm).sum())
        if total < best_sum:
            best, best_sum = shares, total
        floor = max(FIRST_FLOOR * 0.5**turn, LAST_FLOOR)
        weights = np.maximum(magnitudes, floor) ** (norm - 2.0)
        for column in range(rank):
            weighted = weights * basis[:, column]
            vector[column] = _dot(weighted, residual)
            for other in range(column + 1):
                matrix[column, other] = matrix[other, column] = _dot(weighted, basis[:, other])
        shares = np.linalg.lstsq(matrix, vector, rcond=None)[0].astype(np.float64)
    return best


def _largest(values: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Where the `count` largest of `values` are, or all of them if there are fewer."""
    if count >= len(values):
        return np.arange(len(values))
    places: NDArray[np.int64] = np.argpartition(values, len(values) - count)[len(values) - count :]
    return places


def _rational(
    adjacency: Adjacency,
    extension: NDArray[np.float64],
    target: NDArray[np.float64],
    spec: FilterSpec,
) -> NDArray[np.float32]:
    """Coefficients of a rational filter (eq. 3), per coordinate never worse than the polynomial of the same degree.

    The denominator minimises the equation error |P(K) x - Q(K) target|, which is linear in both; its
    coefficients are halved until it is safely positive. The numerator is then the best one for this
    denominator.
    """
    coefficients = np.zeros((3, coefficient_count(spec)), np.float32)
    plain = coefficients.copy()
    for axis in range(3):
        values, true = np.ascontiguousarray(extension[:, axis]), np.ascontiguousarray(target[:, axis])
        plain[axis, : spec.degree + 1] = _polynomial(adjacency, values, true, spec)
        denominator = _denominator(adjacency, values, true, spec.degree, spec.denominator_degree, spec.basis)
        divided = divide(adjacency, values, denominator)
        coefficients[axis, : spec.degree + 1] = _polynomial(adjacency, divided, true, spec)
        coefficients[axis, spec.degree + 1 :] = denominator
    error = target - predict(adjacency, extension, spec, coefficients)
    plain_spec = dataclasses.replace(spec, kind="polynomial")
    plain_error = target - predict(adjacency, extension, plain_spec, plain[:, : spec.degree + 1].copy())
    for axis in range(3):
        better = np.ascontiguousarray(error[:, axis])
        worse = np.ascontiguousarray(plain_error[:, axis])
        if _dot(better, better) >= _dot(worse, worse):
            coefficients[axis] = plain[axis]
    return coefficients


def _denominator(
    adjacency: Adjacency,
    values: NDArray[np.float64],
    target: NDArray[np.float64],
    degree: int,
    denominator_degree: int,
    basis: Basis,
) -> NDArray[np.float32]:
    """(q_1, q_2, ...) of least equation error, shrunk until `divide` accepts them; zeros if it never does."""
    columns = np.concatenate(
        [
            basis_columns(adjacency, values, degree, basis),
            -basis_columns(adjacency, target, denominator_degree, "power")[:, 1:],
        ],
        axis=1,
    )
    joint = _fitted(adjacency, np.asfortranarray(columns), target - values, 2.0)
    denominator = joint[degree + 1 :]
    for _ in range(DENOMINATOR_SHRINKAGES):
        if is_safe_denominator(denominator):
            return denominator
        denominator = denominator * np.float32(0.5)
    return np.zeros(denominator_degree, np.float32)
