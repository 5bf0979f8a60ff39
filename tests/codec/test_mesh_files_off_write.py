"""OFF files that are written: they read back to the same mesh, and what is lost is told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.attributes import NONE, Attribute, Domain, Kind
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.off import read_off, write_off
from meshtide_codec.mesh_files.polygons import triangulated
from meshtide_codec.mesh_files.source import Source
from meshtide_codec.scene import Image, Material, Scene
from meshtide_codec.testing import tetrahedron

FLOATS = np.array([[0.1, 0.2, 0.3], [1, 0, 1 / 3], [0, 0, 1], [1, 1, 1]])


def color(values: Any, domain: Domain = Domain.VERTEX, indices: Any = None) -> Attribute:
    table = np.asarray(values)
    rows = None if indices is None else np.asarray(indices)
    return Attribute("COLOR_0", Kind.COLOR, domain, table, rows, normalized=table.dtype.kind in "iu")


def with_attributes(*attributes: Attribute) -> Mesh:
    return Mesh.checked(tetrahedron().vertices + 1 / 3, tetrahedron().faces, attributes)


def again(mesh: Mesh) -> tuple[str, Mesh, tuple[str, ...]]:
    """The keyword, the mesh that is read, what is told in writing."""
    written = write_off(Scene.of(mesh), "a.off")
    source = Source("a.off", ".off", written.data)
    found = read_off(source, FileLimits()).mesh()
    assert [note for note in source.notes if "cross themselves" not in note] == []  # as random polygons may
    assert written.companions == {}
    return written.data.split()[0].decode(), found, written.notes


FULL = np.array([[255, 0, 3], [0, 0, 0], [1, 1, 1], [9, 8, 7]], np.uint8)


@pytest.mark.parametrize(
    ("attributes", "keyword"),
    [
        ([], "OFF"),
        ([color(FULL)], "COFF"),
        ([color(FLOATS)], "COFF"),
        ([color(np.column_stack([FULL, FULL[:, 0]]))], "COFF"),
        ([Attribute("NORMAL", Kind.NORMAL, Domain.VERTEX, -FLOATS)], "NOFF"),
        ([Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.VERTEX, 7 * FLOATS[:, :2])], "STOFF"),
        ([color(FULL, Domain.FACE)], "OFF"),
        ([color(FLOATS, Domain.FACE)], "OFF"),
        ([color(FULL, Domain.FACE, [3, 0, NONE, 0])], "OFF"),
        ([Attribute("COLOR_INDEX", Kind.LABEL, Domain.FACE, np.array([[4], [0], [2], [9]], np.int32))], "OFF"),
        (
            [
                Attribute("NORMAL", Kind.NORMAL, Domain.VERTEX, FLOATS),
                color(FULL),
                Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.VERTEX, FLOATS[:, 1:]),
                color(FLOATS, Domain.FACE),
            ],
            "STCNOFF",
        ),
    ],
)
def test_attributes_read_back(attributes: list[Attribute], keyword: str) -> None:
    mesh = with_attributes(*attributes)
    written, found, notes = again(mesh)
    assert (written, notes) == (keyword, ())
    assert found.vertices.tolist() == mesh.vertices.tolist()
    assert found.faces.tolist() == mesh.faces.tolist()
    assert len(found.attributes) == len(attributes)
    for one, other in zip(mesh.attributes, found.attributes, strict=True):
        assert (one.name, one.kind, one.domain, one.normalized) == (
            other.name,
            other.kind,
            other.domain,
            other.normalized,
        )
        assert one.per_element().tolist() == other.per_element().tolist()
        assert ((one.rows() == NONE) == (other.rows() == NONE)).all()


def test_dark_bytes_are_written_as_floats_lest_they_be_taken_for_bright_ones() -> None:
    dark = np.array([[1, 0, 1], [0, 0, 0], [1, 1, 1], [0, 0, 1]], np.uint8)
    _, found, _ = again(with_attributes(color(dark)))
    assert np.allclose(found.attributes[0].values, dark / 255)


def test_integers_become_floats() -> None:
    shorts = color(np.array([[65535, 0, 1]] * 4, np.uint16))
    normals = Attribute("NORMAL", Kind.NORMAL, Domain.VERTEX, np.array([[-128, 0, 127]] * 4, np.int8), normalized=True)
    _, found, _ = again(with_attributes(shorts, normals))
    assert found.attributes[0].values.tolist() == [[-1, 0, 1]] * 4
    assert found.attributes[1].values.tolist() == [[1, 0, 1 / 65535]] * 4


@pytest.mark.parametrize(
    ("attribute", "note"),
    [
        (color(FLOATS * 2), "colours (4)"),
        (color(FLOATS - 1), "colours (4)"),
        (color(FLOATS, Domain.CORNER, np.zeros((4, 3), int)), "colours (4)"),
        (color(FULL, Domain.VERTEX, [0, 1, 2, NONE]), "colours (4)"),
        (Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.VERTEX, FLOATS), "texture coordinates (4)"),
        (Attribute("quality", Kind.SCALAR, Domain.VERTEX, FLOATS[:, :1]), "quality (4)"),
        (Attribute("part", Kind.LABEL, Domain.FACE, FULL[:, :1]), "part (4)"),
    ],
)
def test_attributes_without_a_place_are_told(attribute: Attribute, note: str) -> None:
    keyword, found, notes = again(with_attributes(attribute))
    assert (keyword, found.attributes, notes) == ("OFF", (), (f"{note}: not kept",))


def test_materials_and_images_are_told() -> None:
    scene = Scene((tetrahedron(),), materials=(Material(),) * 2, images=(Image("a", b""),))
    assert write_off(scene, "a.off").notes == ("2 materials, 1 image: not kept",)
    second = color(FULL)
    notes = write_off(Scene.of(with_attributes(color(FULL), second)), "a.off").notes
    assert notes == ("colours (4): not kept",)


@given(st.lists(st.integers(3, 7), min_size=1, max_size=5), st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_polygons_with_colours_read_back(sizes: list[int], seed: int) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(size=(8, 3))
    corners = np.concatenate([random.permutation(8)[:size] for size in sizes])
    cut = triangulated(points, np.array(sizes), corners)
    colors = random.integers(2, 255, (len(sizes), 4), dtype=np.uint8)
    mesh = Mesh.checked(points, corners[cut.corners], [color(colors, Domain.FACE, cut.polygon)], polygons=cut.inner)
    _, found, notes = again(mesh)
    assert notes == ()
    assert [rotated(one) for one in found.polygons_as_lists()] == [rotated(one) for one in mesh.polygons_as_lists()]
    assert found.attributes[0].per_element().tolist() == colors[cut.polygon].tolist()


def rotated(polygon: list[int]) -> list[int]:
    first = polygon.index(min(polygon))
    return polygon[first:] + polygon[:first]
