"""Beams: no triangle of a node sticks out of its beam, and searches among slivers visit few nodes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshes import grid, random_meshes
from meshtide_codec.beam_kernels import BEAM, COUNT, LINK, squared_distance_to_beam
from meshtide_codec.closest_points import TriangleTree
from meshtide_codec.mesh import Mesh


def fan(count: int, *, height: float = 0.0) -> Mesh:
    """`count` slivers around vertex 0, which stands `height` above the circle of the others."""
    turn = 2 * np.pi * np.arange(count) / count
    rim = np.stack([np.cos(turn), np.sin(turn), np.zeros(count)], axis=1)
    step = np.arange(count)
    faces = np.stack([np.zeros(count, np.int64), 1 + step, 1 + (step + 1) % count], axis=1)
    return Mesh.checked(np.concatenate([[[0.0, 0.0, height]], rim]), faces)


def turned_tube(count: int) -> Mesh:
    """A strip of `count` slivers along the sides of a tube that lies across all axes."""
    turn = 2 * np.pi * np.arange(count // 2) / (count // 2)
    circle = 0.1 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    axis = np.array([1.0, 1.3, 0.8])
    step = np.arange(count // 2)
    after = (step + 1) % (count // 2)
    lower = np.stack([step, after, step + count // 2], axis=1)
    upper = np.stack([after, after + count // 2, step + count // 2], axis=1)
    return Mesh.checked(np.concatenate([circle, circle + axis]), np.concatenate([lower, upper]))


def beams_of(tree: TriangleTree) -> list[tuple[int, list[int]]]:
    """Each beam, and the places of the triangles that it bounds."""
    _, _, links, _, _ = tree._tree

    def triangles(node: int) -> list[int]:
        if links[node, COUNT]:
            return list(range(links[node, LINK], links[node, LINK] + links[node, COUNT]))
        return triangles(node + 1) + triangles(int(links[node, LINK]))

    return [(int(links[node, BEAM]), triangles(node)) for node in range(len(links)) if links[node, BEAM] >= 0]


@settings(deadline=None, max_examples=40)
@given(random_meshes(30), st.floats(0.0, 0.02), st.integers(0, 2**32 - 1))
def test_a_beam_never_claims_more_than_the_distance_of_its_triangles(mesh: Mesh, width: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    flat = mesh.vertices - (1.0 - width) * (mesh.vertices - (mesh.vertices @ direction)[:, None] * direction)
    tree = TriangleTree(flat, mesh.faces)
    points = np.concatenate([flat, rng.normal(size=(10, 3)) * max(mesh.diagonal, 1e-3) + flat.mean(axis=0)])
    for beam, places in beams_of(tree):
        own = TriangleTree(tree.vertices, tree.faces[places])
        for point in points:
            actual = own.mean_and_largest(point[None])[0]
            assert squared_distance_to_beam(tree._beams, beam, *point) <= actual + 1e-24 * mesh.diagonal**2


def test_slivers_across_the_axes_have_beams_and_ordinary_triangles_do_not() -> None:
    slivers = fan(500)
    assert len(beams_of(TriangleTree(slivers.vertices, slivers.faces))) > 400
    patch = grid(20)
    assert beams_of(TriangleTree(patch.vertices, patch.faces)) == []


@pytest.mark.parametrize(
    ("name", "mesh"),
    [("flat", fan(30_000)), ("cone", fan(30_000, height=1.0)), ("tube", turned_tube(30_000))],
    ids=["flat", "cone", "tube"],
)
def test_a_search_among_thousands_of_slivers_visits_few_nodes(name: str, mesh: Mesh) -> None:
    tree = TriangleTree(mesh.vertices, mesh.faces)
    assert tree.visits_per_search(tree.samples(1000, seed=1).points) <= 300, name
