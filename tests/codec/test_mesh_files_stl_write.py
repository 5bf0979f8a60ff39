"""Binary STL files as they are written: read back, with normals, and what is not kept told."""

from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.attributes import Attribute, Domain, Kind
from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.source import Source
from meshtide_codec.mesh_files.stl import read_stl, write_stl
from meshtide_codec.scene import Material, Scene
from meshtide_codec.testing import grid, tetrahedron

POINTS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
FACES = [[0, 1, 2], [1, 3, 2]]


def read(data: bytes) -> tuple[Mesh, list[str]]:
    source = Source("a.stl", ".stl", data)
    return read_stl(source, FileLimits()).mesh(), source.notes


def test_what_is_written_reads_back() -> None:
    mesh = tetrahedron()
    written = write_stl(Scene.of(mesh), "a.stl")
    assert written.notes == ()
    assert not written.data.startswith(b"solid")
    again, notes = read(written.data)
    assert notes == []
    assert np.array_equal(again.vertices[again.faces], mesh.vertices[mesh.faces])
    normals = np.frombuffer(written.data, "<f4", 3, 84)
    assert normals.tolist() == [0, 0, -1]


def test_what_is_not_kept_is_told() -> None:
    mesh = grid(5)
    color = Attribute("COLOR_0", Kind.COLOR, Domain.VERTEX, np.zeros((25, 3), np.uint8), normalized=True)
    inner = np.zeros((32, 3), bool)
    inner[:16, 1] = inner[16:, 0] = True
    order = np.arange(32).reshape(2, 16).T.reshape(-1)
    quads = Mesh.checked(mesh.vertices, mesh.faces[order], [color], polygons=inner[order])
    assert [len(one) for one in quads.polygons_as_lists()] == [4] * 16
    written = write_stl(Scene.of(quads, [Material("a")]), "a.stl")
    rounding = np.abs(mesh.vertices - mesh.vertices.astype(np.float32)).max()
    assert written.notes == (
        f"positions are rounded to single precision, by {rounding:.2g} at most",
        "colours (25), 1 material, 16 polygons (now triangles): not kept",
    )


def test_positions_beyond_single_precision_are_not_written() -> None:
    mesh = Mesh.checked(np.array(POINTS) * 1e39, FACES)
    with pytest.raises(MeshFileError, match="too large for single precision"):
        write_stl(Scene.of(mesh), "a.stl")


def test_faces_without_area_have_no_normal() -> None:
    mesh = Mesh.checked(POINTS, [[0, 0, 1], [0, 1, 2]])
    assert np.frombuffer(write_stl(Scene.of(mesh), "a.stl").data, "<f4", 3, 84).tolist() == [0, 0, 0]
