"""The line that tells what a stream or a written file does not keep."""

from __future__ import annotations

import numpy as np

from meshtide_codec.attributes import Attribute, Domain, Kind
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.not_kept import not_kept, notes_of_encoding
from meshtide_codec.mesh_files.read import mesh_of
from meshtide_codec.scene import Image, Material, Node, Scene

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])
INNER = np.array([[False, False, True], [True, False, False]])


def test_nothing_is_said_of_nothing() -> None:
    assert not_kept(Scene(())) == []


def test_one_line_counts_all() -> None:
    kinds = [
        ("COLOR_0", Kind.COLOR),
        ("COLOR_1", Kind.COLOR),
        ("TEXCOORD_0", Kind.TEXCOORD),
        ("N", Kind.NORMAL),
        ("q", Kind.SCALAR),
    ]
    attributes = [Attribute(name, kind, Domain.VERTEX, np.zeros((4, 2))) for name, kind in kinds]
    mesh = Mesh(SQUARE, HALVES, tuple(attributes), polygons=INNER)
    nodes = (Node(0), Node(0))
    scene = Scene(
        (mesh,), nodes, (0, 1), (Material(), Material()), (Image("a", b""),), document={"animations": [{}, {}]}
    )
    told = "colours (4), colours COLOR_1 (4), texture coordinates (4), normals N (4), q (4), 2 materials, 1 image"
    rest = "2 nodes (their meshes become one), 2 animations, 1 polygon (now triangles)"
    assert not_kept(scene) == [f"{told}, {rest}: not kept"]
    assert not_kept(scene, attributes[4:], kept=["materials", "nodes", "animations"]) == [
        "q (4), 1 image, 1 polygon (now triangles): not kept"
    ]
    assert not_kept(scene, [], kept=["materials", "images", "nodes", "animations", "polygons"]) == []


def test_values_of_several_meshes_are_counted_together() -> None:
    color = Attribute("COLOR_0", Kind.COLOR, Domain.VERTEX, np.zeros((4, 3)))
    mesh = Mesh(SQUARE, HALVES, (color,))
    assert not_kept(Scene((mesh, mesh))) == ["colours (8): not kept"]


def test_what_was_noted_while_reading_comes_first() -> None:
    scene = Scene.of(Mesh(SQUARE, HALVES, polygons=INNER))
    loaded = mesh_of(Scene(scene.geometries, scene.nodes, scene.roots, notes=("a note",)))
    assert notes_of_encoding(scene, loaded) == ["a note", "1 polygon (now triangles): not kept"]
