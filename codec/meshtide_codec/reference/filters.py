"""Predictions of profile classic: filters in K of the level's vertex graph (docs/format.md, section 7.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meshtide_codec.reference.octree import Face

    Column = list[float]
    """One coordinate of all vertices."""

RELATIVE_RESIDUAL = 1e-11
MOST_STEPS = 256


class Graph:
    """The neighbours of each vertex in ascending order: the other corners of its faces."""

    def __init__(self, faces: list[Face], vertices: int) -> None:
        around: list[set[int]] = [set() for _ in range(vertices)]
        for a, b, c in faces:
            around[a] |= {b, c}
            around[b] |= {c, a}
            around[c] |= {a, b}
        self.neighbours = [sorted(others - {vertex}) for vertex, others in enumerate(around)]

    def apply_k(self, values: Column) -> Column:
        """Each value minus the mean over the neighbours; 0 where there are none."""
        result = []
        for value, others in zip(values, self.neighbours, strict=True):
            total = 0.0
            for other in others:
                total += values[other]
            result.append(value - total / len(others) if others else 0.0)
        return result

    def dot(self, one: Column, other: Column) -> float:
        """Inner product weighted by the numbers of neighbours."""
        total = 0.0
        for a, b, others in zip(one, other, self.neighbours, strict=True):
            total += len(others) * (a * b)
        return total


def coefficient_count(spec: dict[str, Any]) -> int:
    """Coefficients that a Param holds for each coordinate."""
    if spec["kind"] not in {"polynomial", "rational"}:
        return 0
    count: int = spec["degree"] + 1 + spec.get("denominator_degree", 0)
    return count


def predict(graph: Graph, x: Column, spec: dict[str, Any], coefficients: list[float]) -> Column:
    """One coordinate of the prediction from the same coordinate of the extension."""
    if spec["kind"] == "zeroth":
        return x
    if spec["kind"] == "gaussian":
        return [value - change for value, change in zip(x, graph.apply_k(x), strict=True)]
    if spec["kind"] == "taubin":
        y = [value + spec["taubin_mu"] * change for value, change in zip(x, graph.apply_k(x), strict=True)]
        return [value - spec["taubin_lambda"] * change for value, change in zip(y, graph.apply_k(y), strict=True)]
    numerator, denominator = coefficients[: spec["degree"] + 1], coefficients[spec["degree"] + 1 :]
    result = (_horner if spec["basis"] == "power" else _clenshaw)(graph, x, numerator)
    if any(denominator):
        result = _divide(graph, result, [1.0, *denominator])
    return [value if others else start for value, start, others in zip(result, x, graph.neighbours, strict=True)]


def _horner(graph: Graph, x: Column, coefficients: list[float]) -> Column:
    """The sum of c_k K^k x."""
    result = [coefficients[-1] * value for value in x]
    for coefficient in coefficients[-2::-1]:
        product = graph.apply_k(result)
        result = [change + coefficient * value for change, value in zip(product, x, strict=True)]
    return result


def _clenshaw(graph: Graph, x: Column, coefficients: list[float]) -> Column:
    """The sum of c_k T_k(K - I) x."""
    result = [coefficients[-1] * value for value in x]
    later = [0.0] * len(x)
    for order in range(len(coefficients) - 2, -1, -1):
        factor = 2.0 if order else 1.0
        product = graph.apply_k(result)
        newer = [
            (factor * (change - now) - after) + coefficients[order] * value
            for change, now, after, value in zip(product, result, later, x, strict=True)
        ]
        later, result = result, newer
    return result


def _divide(graph: Graph, right_side: Column, denominator: list[float]) -> Column:
    """Solve Q(K) x = right side by conjugate gradients that start at the right side."""

    def image_of(values: Column) -> Column:
        return _horner(graph, values, denominator)

    solution = right_side
    residual = _combined(right_side, -1.0, image_of(right_side))
    direction = residual
    goal = RELATIVE_RESIDUAL * RELATIVE_RESIDUAL * graph.dot(right_side, right_side)
    energy = graph.dot(residual, residual)
    for _ in range(MOST_STEPS):
        if energy <= goal:
            break
        image = image_of(direction)
        curvature = graph.dot(direction, image)
        if not curvature > 0.0:
            break
        step = energy / curvature
        solution = _combined(solution, step, direction)
        residual = _combined(residual, -step, image)
        next_energy = graph.dot(residual, residual)
        direction = _combined(residual, next_energy / energy, direction)
        energy = next_energy
    return solution


def _combined(one: Column, factor: float, other: Column) -> Column:
    return [a + factor * b for a, b in zip(one, other, strict=True)]
