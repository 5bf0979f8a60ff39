"""The line that tells what a written file does not keep."""

from __future__ import annotations

import numpy as np

from meshtide_codec.attributes import Attribute, Domain, Kind
from meshtide_codec.mesh_files.left_out import not_kept
from meshtide_codec.scene import Image, Material, Scene


def test_nothing_is_said_of_nothing() -> None:
    assert not_kept(Scene(()), []) == []


def test_one_line_counts_all() -> None:
    kinds = [
        ("COLOR_0", Kind.COLOR),
        ("COLOR_1", Kind.COLOR),
        ("UV", Kind.TEXCOORD),
        ("N", Kind.NORMAL),
        ("q", Kind.SCALAR),
    ]
    attributes = [Attribute(name, kind, Domain.VERTEX, np.zeros((4, 2))) for name, kind in kinds]
    scene = Scene((), materials=(Material(), Material()), images=(Image("a", b""),))
    assert not_kept(scene, attributes, polygons=1) == [
        "colours (8), texture coordinates (4), normals (4), q (4), 2 materials, 1 image, 1 polygon: not kept"
    ]
