"""What quantization merges is counted, apart from what the input had, and the B that keeps it is right."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec import merging
from meshtide_codec.errors import MeshError
from meshtide_codec.merging import Merging, merged_by_quantization
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import QuantizedMesh, quantize
from meshtide_codec.testing import grid, random_meshes, shapes


def outlier() -> Mesh:
    """A patch, and a triangle that reaches far away from it."""
    patch = grid(30)
    far = np.array([[1e7, 0.0, 0.0], [1e7, 5e6, 0.0], [1e7, 0.0, 5e6]])
    return Mesh(np.concatenate([patch.vertices, far]), np.concatenate([patch.faces, [[900, 901, 902]]]))


def thin() -> Mesh:
    """A long ribbon of 900 vertices, too narrow for a step of 12 bits."""
    patch = grid(30)
    return Mesh(patch.vertices * [1.0, 1e-5, 0.0], patch.faces)


def test_the_loss_of_a_mesh_with_an_outlier_is_told() -> None:
    found = merged_by_quantization(outlier(), quantize(outlier(), 12))
    assert found.noticed
    assert (found.faces, found.of_faces, found.of_vertices) == (1682, 1683, 903)
    assert found.vertices == 899
    assert found.area < 1e-5
    assert found.keeping_bits is None
    assert "merges 1682 of 1683 faces" in found.message()
    assert "no B up to 20 keeps them" in found.message()


def test_the_b_that_keeps_a_thin_mesh_is_the_smallest() -> None:
    mesh = Mesh(thin().vertices * [1, 10, 1], thin().faces)
    found = merged_by_quantization(mesh, quantize(mesh, 12))
    assert found.complete
    assert found.keeping_bits is not None
    assert found.message() == f"all 1682 faces vanish at B = 12; B = {found.keeping_bits} keeps them"
    assert not merged_by_quantization(mesh, quantize(mesh, found.keeping_bits)).noticed
    for bits in range(12, found.keeping_bits):
        assert merged_by_quantization(mesh, quantize(mesh, bits)).noticed


def test_what_was_degenerate_or_repeated_in_the_input_does_not_count() -> None:
    mesh = grid(12)
    twin = np.concatenate([mesh.vertices, mesh.vertices[:40]])  # the same places again, as in a file with seams
    own = np.concatenate([mesh.faces, mesh.faces[:50], mesh.faces[:9, [0, 0, 2]], [[0, 144, 1]], [[145, 12, 0]]])
    found = merged_by_quantization(Mesh(twin, own), quantize(Mesh(twin, own), 12))
    assert found == Merging(12, 0, found.of_faces, 0.0, 0, 144)
    assert not found.noticed


@given(random_meshes(), st.integers(4, 8))
@settings(max_examples=40, deadline=None)
def test_counts_agree_with_a_plain_search(mesh: Mesh, bits: int) -> None:
    quantized = quantize(mesh, bits)

    def distinct(labels: list[object]) -> set[frozenset[tuple[object, object]]]:
        faces = [[labels[corner] for corner in face] for face in mesh.faces.tolist()]
        return {frozenset(zip(face, [*face[1:], face[0]], strict=True)) for face in faces if len(set(face)) == 3}

    before = distinct([tuple(row) for row in mesh.vertices.tolist()])
    after = distinct(quantized.permutation.tolist())
    found = merged_by_quantization(mesh, quantized)
    assert len(after) == len(quantized.faces)
    if quantized.dropped_faces:
        assert (found.of_faces, found.faces) == (len(before), len(before) - len(after))
    assert 0.0 <= found.area <= 1.0


def test_no_other_b_is_tried_while_little_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []

    def counted(mesh: Mesh, bits: int, origin: object, extent: object) -> QuantizedMesh:
        del origin, extent
        tried.append(bits)
        return quantize(mesh, bits)

    monkeypatch.setattr(merging, "quantize", counted)
    merged_by_quantization(grid(60), quantize(grid(60), 12))
    assert tried == []
    merged_by_quantization(thin(), quantize(thin(), 12))
    assert tried[:2] == [13, 14]


def test_files_without_a_surface_are_refused() -> None:
    points = shapes()["points"]()
    with pytest.raises(MeshError, match="no face of three different corners"):
        merged_by_quantization(points, quantize(points, 12)).check(strict=False)
    found = merged_by_quantization(outlier(), quantize(outlier(), 12))
    found.check(strict=False)
    with pytest.raises(MeshError, match="merges 1682"):
        found.check(strict=True)
