"""Properties of PLY files by their names."""

from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.attributes import NONE, Attribute, Domain, Kind
from meshtide_codec.mesh_files.ply.attributes import attributes_of, corner_texcoords
from meshtide_codec.mesh_files.ply.rows import ListColumn


def of_names(names: str, kind: str = "f4", domain: Domain = Domain.VERTEX) -> list[Attribute]:
    columns = {name: np.array([at, at + 10], kind) for at, name in enumerate(names.split())}
    return attributes_of(columns, domain)


@pytest.mark.parametrize(
    ("names", "name", "meaning"),
    [
        ("red green blue", "COLOR_0", Kind.COLOR),
        ("red green blue alpha", "COLOR_0", Kind.COLOR),
        ("RED Green blue", "COLOR_0", Kind.COLOR),
        ("r g b", "COLOR_0", Kind.COLOR),
        ("r g b a", "COLOR_0", Kind.COLOR),
        ("diffuse_red diffuse_green diffuse_blue", "COLOR_0", Kind.COLOR),
        ("nx ny nz", "NORMAL", Kind.NORMAL),
        ("s t", "TEXCOORD_0", Kind.TEXCOORD),
        ("u v", "TEXCOORD_0", Kind.TEXCOORD),
        ("texture_u texture_v", "TEXCOORD_0", Kind.TEXCOORD),
        ("quality", "quality", Kind.SCALAR),
        ("Confidence", "Confidence", Kind.SCALAR),
    ],
)
@pytest.mark.parametrize("kind", ["u1", "u2", ">i4", "f4", ">f8"])
def test_names_tell_the_kind(names: str, name: str, meaning: Kind, kind: str) -> None:
    (one,) = of_names(names, kind)
    assert (one.name, one.kind, one.domain) == (name, meaning, Domain.VERTEX)
    width = len(names.split())
    assert one.values.tolist() == [list(range(width)), list(range(10, 10 + width))]
    assert one.values.dtype == np.dtype(kind).newbyteorder("=")
    assert one.normalized == (meaning is Kind.COLOR and kind in {"u1", "u2", ">i4"})


def test_parts_of_a_set_are_scalars() -> None:
    assert [one.name for one in of_names("red green nx s alpha")] == ["red", "green", "nx", "s", "alpha"]
    columns = {"red": np.zeros(1, "u1"), "green": np.zeros(1, "u1"), "blue": np.zeros(1, "f4")}
    assert [one.kind for one in attributes_of(columns, Domain.VERTEX)] == [Kind.SCALAR] * 3
    columns |= {"blue": np.zeros(1, "u1"), "alpha": np.zeros(1, "f4")}
    assert [(one.name, one.values.shape[1]) for one in attributes_of(columns, Domain.VERTEX)] == [
        ("COLOR_0", 3),
        ("alpha", 1),
    ]


def test_several_sets_are_numbered() -> None:
    assert [one.name for one in of_names("s t texture_u texture_v red green blue r g b")] == [
        "COLOR_0",
        "COLOR_1",
        "TEXCOORD_0",
        "TEXCOORD_1",
    ]
    found = attributes_of({"u": np.zeros(1), "v": np.zeros(1)}, Domain.VERTEX, ["TEXCOORD_0"])
    assert found[0].name == "TEXCOORD_1"


def test_a_name_is_there_once() -> None:
    assert [one.name for one in of_names("red green blue COLOR_0")] == ["COLOR_0", "COLOR_0_"]
    found = attributes_of({"q": np.zeros(1)}, Domain.FACE, ["q", "face_q"])
    assert [(one.name, one.extra) for one in found] == [("face_q_", {"property": "q"})]


def test_texture_coordinates_of_faces_are_scalars() -> None:
    assert [(one.name, one.kind) for one in of_names("u v", domain=Domain.FACE)] == [
        ("u", Kind.SCALAR),
        ("v", Kind.SCALAR),
    ]


def test_lists_of_coordinates_of_triangles() -> None:
    items = np.arange(12, dtype=">f4")
    counts = np.array([3, 3])
    one, odd = corner_texcoords(ListColumn(np.array([6, 6]), items.reshape(2, 6)), counts, None, None)
    assert (one.indices, odd) == (None, 0)
    assert one.values.tolist() == items.reshape(6, 2).tolist()
    assert one.values.dtype == np.float32
    one, odd = corner_texcoords(ListColumn(np.array([0, 6]), items[:6]), counts, None, None)
    assert (one.rows().tolist(), odd) == ([NONE, NONE, NONE, 0, 1, 2], 0)
    one, odd = corner_texcoords(ListColumn(np.array([5, 6]), items[:11]), counts, None, None)
    assert (one.rows().tolist(), odd) == ([NONE, NONE, NONE, 0, 1, 2], 1)
    assert one.values.tolist() == items[5:11].reshape(3, 2).tolist()
