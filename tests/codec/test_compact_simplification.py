"""Simplification: targets are met, sheets stay apart while they can, borders and volumes stay, hubs end in time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.compact.simplification import Simplifier
from meshtide_codec.mesh import Mesh, canonical_faces
from meshtide_codec.quantize import QuantizedMesh, morton_codes, quantize
from meshtide_codec.sphere import paper_sphere
from meshtide_codec.testing import grid

Points = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int32]


def simplifier(quantized: QuantizedMesh, finest_target: int) -> Simplifier:
    return Simplifier(quantized.positions, quantized.faces, quantized.bits, finest_target)


def edge_uses(faces: Integers) -> npt.NDArray[np.int64]:
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    uses: npt.NDArray[np.int64] = np.unique(edges, axis=0, return_counts=True)[1]
    return uses


def volume(vertices: Points, faces: Integers) -> float:
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return float((np.cross(a, b) * c).sum() / 6)


def test_a_closed_surface_stays_closed_and_keeps_its_volume() -> None:
    sphere = quantize(paper_sphere(4), 12)
    whole = volume(sphere.positions.astype(float), sphere.faces)
    coarser = simplifier(sphere, 300)
    for target, tolerance in ((300, 0.01), (60, 0.05), (20, 0.15)):
        vertices, faces = coarser.reduced_to(target)
        assert len(vertices) == target
        assert len(faces) == 2 * target - 4
        assert (edge_uses(faces) == 2).all()
        assert abs(volume(vertices, faces) / whole - 1) < tolerance


def test_clusters_change_little() -> None:
    sphere = quantize(paper_sphere(5), 12)  # of 10242 vertices, so that the first step is to cluster them
    whole = volume(sphere.positions.astype(float), sphere.faces)
    vertices, faces = simplifier(sphere, 100).reduced_to(100)
    assert len(vertices) == 100
    assert (edge_uses(faces) == 2).all()
    assert abs(volume(vertices, faces) / whole - 1) < 0.03


def test_a_plane_needs_few_vertices_and_keeps_its_outline() -> None:
    plane = quantize(Mesh(grid(30).vertices * [1, 1, 0], grid(30).faces), 12)
    vertices, faces = simplifier(plane, 8).reduced_to(8)
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    area = np.cross(b - a, c - a)[:, 2].sum() / 2
    assert area > 0.995 * 4095**2


def test_separate_sheets_are_glued_only_when_nothing_else_is_left() -> None:
    sheets = np.concatenate([grid(12).vertices + np.array([0, 0, 40 * layer]) for layer in range(6)])
    faces = np.concatenate([grid(12).faces + 144 * layer for layer in range(6)])
    quantized = quantize(Mesh(sheets, faces), 12)
    coarser = simplifier(quantized, 60)
    assert edge_uses(coarser.reduced_to(60)[1]).max() == 2
    assert len(coarser.reduced_to(10)[0]) <= 10


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 300), st.integers(0, 900), st.integers(1, 50))
def test_any_mesh_gets_no_larger_and_stays_well_formed(seed: int, count: int, face_count: int, target: int) -> None:
    rng = np.random.default_rng(seed)
    positions = rng.integers(0, 64, (count, 3)).astype(np.int32)
    positions = positions[np.unique(morton_codes(positions), return_index=True)[1]]
    faces = canonical_faces(rng.integers(0, len(positions), (face_count, 3)).astype(np.int32))
    vertices, coarse = Simplifier(positions, faces, 6, target).reduced_to(target)
    assert len(vertices) <= len(positions)
    assert np.isfinite(vertices).all()
    assert (canonical_faces(coarse) == coarse).all()
    assert (np.unique(coarse) == np.arange(len(vertices))).all()
    assert len(coarse) <= len(faces)


def test_a_hub_of_many_faces_ends_in_time() -> None:
    angles = np.linspace(0, 2 * np.pi, 4000)
    rim = np.stack([np.cos(angles), np.sin(angles), np.sin(9 * angles)], axis=1)
    vertices = np.concatenate([[[0.0, 0, 0]], rim])
    fan = quantize(Mesh.checked(vertices, [[0, i, i + 1] for i in range(1, 4000)]), 16)
    vertices, faces = simplifier(fan, 400).reduced_to(400)
    assert len(vertices) <= len(fan.positions)
    assert len(faces) > 0
