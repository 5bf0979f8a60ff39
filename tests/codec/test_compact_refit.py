"""Refit: vertices come closer to the surface, also on a grid, and least squares are least."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from meshtide_codec.closest_points import TriangleTree
from meshtide_codec.compact import refit_kernels
from meshtide_codec.compact.refit import Refitter
from meshtide_codec.compact.refit_kernels import Rows
from meshtide_codec.sphere import paper_sphere

Points = npt.NDArray[np.float64]


def random_rows(seed: int, count: int, vertices: int) -> Rows:
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return Rows(
        rng.integers(0, vertices, (count, 3)).astype(np.int32),
        rng.dirichlet([1, 1, 1], count),
        directions,
        rng.normal(size=count) * 5,
    )


def as_matrix(rows: Rows, vertices: int) -> Points:
    matrix = np.zeros((len(rows.targets), vertices, 3))
    for corner in range(3):
        np.add.at(
            matrix,
            (np.arange(len(rows.targets)), rows.corners[:, corner]),
            rows.weights[:, corner, None] * rows.directions,
        )
    return matrix.reshape(len(rows.targets), -1)


def test_the_solution_is_that_of_least_squares() -> None:
    rows, start, stiffness = random_rows(1, 200, 20), np.random.default_rng(2).normal(size=(20, 3)), 0.3
    solution = refit_kernels.solve(rows, start, stiffness, 200, 1e-12)
    matrix = as_matrix(rows, 20)
    stacked = np.concatenate([matrix, np.sqrt(stiffness) * np.eye(60)])
    wanted = np.concatenate([rows.targets, np.sqrt(stiffness) * start.ravel()])
    expected = np.linalg.lstsq(stacked, wanted, rcond=None)[0]
    assert np.allclose(solution.ravel(), expected, atol=1e-8)


def test_rounding_finds_no_worse_points_than_the_nearest_and_stays_in_the_grid() -> None:
    rows, step, last, stiffness = random_rows(3, 300, 20), 2.0, 3, 0.01
    wanted = np.clip(np.random.default_rng(4).normal(size=(20, 3)) * 4, 0, last * step)
    grid = np.rint(wanted / step).astype(np.int32)

    def energy(points: npt.NDArray[np.int32]) -> float:
        values = np.empty(len(rows.targets))
        refit_kernels.residuals(rows, points * step, values)
        return float((values**2).sum() + stiffness * ((points * step - wanted) ** 2).sum())

    before = energy(grid)
    refit_kernels.round_to_grid(rows, wanted, grid, step, last, stiffness, 50)
    after = energy(grid)
    assert after < before
    assert grid.min() >= 0
    assert grid.max() <= last
    for vertex in range(20):  # no single move makes it better
        for move in np.ndindex(3, 3, 3):
            other = grid.copy()
            other[vertex] += np.array(move, np.int32) - 1
            if other.min() >= 0 and other.max() <= last:
                assert energy(other) >= after * (1 - 1e-12)


def test_a_coarse_sphere_grows_to_meet_the_fine_one() -> None:
    fine, coarse = paper_sphere(4), paper_sphere(1)
    original = TriangleTree(1000 * fine.vertices, fine.faces)
    refitter = Refitter(original, coarse.faces.astype(np.int32), len(coarse.vertices))
    inscribed = 1000 * coarse.vertices
    fitted = refitter.fitted(inscribed)
    assert refitter.distance(fitted) < refitter.distance(inscribed) / 2
    assert np.linalg.norm(fitted, axis=1).mean() > np.linalg.norm(inscribed, axis=1).mean()
    shifted = fitted + 2000
    refitter = Refitter(TriangleTree(1000 * fine.vertices + 2000, fine.faces), coarse.faces.astype(np.int32), 42)
    step = 4000 / 31
    nearest = np.rint(shifted / step) * step
    rounded = refitter.rounded(shifted, step, 31)
    assert refitter.distance(rounded * step) < 0.95 * refitter.distance(nearest)
