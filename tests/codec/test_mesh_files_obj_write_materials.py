from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.obj.materials import parse_mtl
from meshtide_codec.mesh_files.obj.statements import without_comment
from meshtide_codec.mesh_files.obj.write_materials import image_files, mtl_text, unique_names, written_name
from meshtide_codec.scene import Image, Material, Scene

MESH = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def lines_of(
    properties: dict[str, Any], images: tuple[Image, ...] = (), textures: object = None
) -> tuple[list[str], int]:
    scene = Scene((MESH,), materials=(Material("a", properties),), images=images, document={"textures": textures})
    text, poorer = mtl_text(scene, ["a"], [image.name for image in images])
    return parse_mtl(text.encode())[b"a"], poorer


def test_materials_of_gltf() -> None:
    properties = {
        "name": "a",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1, 0.125],
            "baseColorTexture": {"index": 1},
            "metallicFactor": 0,
            "roughnessFactor": 0.75,
        },
        "emissiveFactor": [1, 0, 0],
        "normalTexture": {"index": 0},
        "alphaMode": "BLEND",
    }
    images = (Image("n.png", b"n"), Image("c.png", b"c"))
    assert lines_of(properties, images, [{"source": 0}, {"source": 1}]) == (
        ["Kd 0.5 0.25 1.0", "d 0.125", "Ke 1.0 0.0 0.0", "Pm 0.0", "Pr 0.75", "map_Kd c.png", "norm n.png"],
        0,
    )


def test_what_mtl_has_no_words_for_is_counted() -> None:
    assert lines_of({"doubleSided": True}) == (["Kd 1.0 1.0 1.0"], 1)
    assert lines_of({"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}})[1] == 1


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-2, 4) | st.floats(allow_nan=False) | st.text(max_size=6),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["index", "source", "x"]), inner, max_size=2)
    ),
    max_leaves=6,
)
KEYS = st.sampled_from(
    ["pbrMetallicRoughness", "emissiveFactor", "normalTexture", "alphaMode", "mtl", "emissiveTexture"]
)
SURFACE = st.dictionaries(st.sampled_from(["baseColorFactor", "baseColorTexture", "metallicFactor"]), JSON, max_size=3)


@settings(max_examples=100, deadline=None)
@given(st.dictionaries(KEYS, JSON | SURFACE, max_size=4), JSON)
def test_properties_of_any_type_become_lines_of_one_material(properties: dict[str, Any], textures: object) -> None:
    scene = Scene(
        (MESH,),
        materials=(Material("a", properties), Material("b")),
        images=(Image("c.png", b""),),
        document={"textures": textures},
    )
    text, _ = mtl_text(scene, ["a", "b"], ["c.png"])
    assert list(parse_mtl(text.encode())) == [b"a", b"b"]


def test_lines_of_mtl_are_kept_but_for_names_of_images() -> None:
    images = (Image("t/a b.png", b"1"),)
    scene = Scene(
        (MESH,), materials=(Material("a", {"mtl": ["Ns 5", r"map_Kd -s 2 2 t\a b.png", "bump c.png"]}),), images=images
    )
    text, poorer = mtl_text(scene, ["a"], image_files(images, []))
    assert parse_mtl(text.encode())[b"a"] == ["Ns 5", "map_Kd -s 2 2 a b.png", "bump c.png"]
    assert poorer == 0


@settings(max_examples=100, deadline=None)
@given(st.lists(st.text(max_size=8) | st.sampled_from(["#", "a #b", "a\\", "\u2028", "\ud800"]), max_size=6))
def test_names_can_be_read_back_and_differ(names: list[str]) -> None:
    written = unique_names(names, "material")
    assert len(set(written)) == len(names)
    for name in written:
        assert without_comment(f" {name}".encode()).decode() == name
        assert not name.endswith("\\")
    assert unique_names(written, "material") == written


def test_ordinary_names_stay() -> None:
    assert [written_name(name) for name in ("Material #25", "Würfel 1", "a#b")] == ["Material #25", "Würfel 1", "a#b"]


@pytest.mark.parametrize(
    ("names", "files"),
    [
        (["a.png", "x/A.png", "../a.png"], ["a.png", "A_2.png", "a_3.png"]),
        (["", "..", "/"], ["image_0.png", "image_1.png", "image_2.png"]),
        (["mesh.OBJ", "mesh.mtl"], ["mesh_2.OBJ", "mesh_2.mtl"]),
        (["a\n\0b|c.jpg", "C:\\d\\e.tga"], ["a__b_c.jpg", "e.tga"]),
    ],
)
def test_images_lie_in_one_folder(names: list[str], files: list[str]) -> None:
    assert image_files([Image(name, b"", "image/png") for name in names], ["mesh.obj", "mesh.mtl"]) == files


def test_long_names_of_images_are_cut() -> None:
    (file,) = image_files([Image("x" * 500 + ".png", b"")], [])
    assert len(file) <= 104
    assert file.endswith(".png")
