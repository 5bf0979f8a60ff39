from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.obj.materials import Materials
from meshtide_codec.mesh_files.obj.scene import Parts, obj_scene
from meshtide_codec.mesh_files.obj.statements import Statements
from meshtide_codec.mesh_files.source import Source
from meshtide_codec.scene import Scene

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def scene_of(parts: Parts, *statements: tuple[bytes, int]) -> Scene:
    found = Statements()
    for line, face in statements:
        found.take(line, face)
    return obj_scene(Source("a", ".obj", b""), parts, found, Materials(rows={b"a": 0}))


def parts_of(counts: list[list[int]], corners: list[list[int]]) -> Parts:
    parts = Parts()
    parts.tables[0].extend([SQUARE[:1], SQUARE[1:]])
    parts.counts.extend((len(one), None if set(one) == {3} else np.array(one)) for one in counts)
    parts.corners[0].extend((len(one), np.array(one, np.int32)) for one in corners)
    return parts


def test_blocks_of_triangles_and_of_polygons_are_joined() -> None:
    parts = parts_of([[3], [4, 3]], [[0, 1, 2], [0, 1, 2, 3, 2, 1, 0]])
    parts.tables[1].extend([np.ones((1, 2)), np.full((1, 3), 2.0)])
    parts.corners[1].extend([(3, None), (7, np.array([0, 1, 0, 1, -1, -1, -1], np.int32))])
    mesh = scene_of(parts, (b"usemtl a", 1), (b"usemtl", 2)).geometries[0]
    assert np.array_equal(mesh.vertices, SQUARE)
    assert mesh.polygons_as_lists() == [[0, 1, 2], [0, 1, 2, 3], [2, 1, 0]]
    assert mesh.materials is not None
    assert mesh.materials.tolist() == [-1, 0, 0, -1]
    (texcoord,) = mesh.attributes
    assert texcoord.values.tolist() == [[1, 1, 0], [2, 2, 2]]
    assert texcoord.rows().reshape(-1, 3).tolist() == [[-1] * 3, [0, 1, 0], [0, 0, 1], [-1] * 3]


def test_no_faces_are_a_mesh_of_points_but_lost_ones_an_error() -> None:
    assert len(scene_of(parts_of([], [])).geometries[0].faces) == 0
    with pytest.raises(MeshFileError, match="none of its faces"):
        scene_of(parts_of([[2, 1]], [[0, 1, 2]]))


def test_colors_of_some_vertices() -> None:
    parts = parts_of([[3]], [[0, 1, 2]])
    parts.colors.append((1, np.array([[1, 0, 0, np.nan], [np.nan] * 4])))
    (color,) = scene_of(parts).geometries[0].attributes
    assert color.per_element().tolist() == [[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0]]
    assert color.rows().tolist() == [-1, 0, -1, -1]
