"""Materials, images and the rest of the JSON: kept as they are, never looked into."""

from __future__ import annotations

import sys
import zlib
from pathlib import Path
from typing import Any

import pytest

from gltf_files import GltfFile, read, refusal_peak, triangle_file
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf import write_gltf

PNG = b"\x89PNG\r\n\x1a\n" + bytes(20)


def test_materials_keep_all_that_they_say() -> None:
    pbr = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "extensions": {"KHR_materials_unlit": {}}}
    rows = [{"name": "gold", **pbr}, {"extras": [1]}, {"name": 3}]
    scene = read(triangle_file(materials=rows))
    assert [one.name for one in scene.materials] == ["gold", "", ""]
    assert scene.materials[0].properties == pbr
    assert scene.materials[1].properties == {"extras": [1]}


def test_images_are_taken_from_views_uris_and_files(tmp_path: Path) -> None:
    (tmp_path / "my wood.jpg").write_bytes(b"\xff\xd8\xff...")
    file = triangle_file()
    view = file.view(PNG)
    file.root["images"] = [
        {"bufferView": view, "mimeType": "image/png", "name": "inside"},
        {"uri": "data:image/webp;base64,UklGRg=="},
        {"uri": "my%20wood.jpg", "extras": {"a": 1}},
        {"uri": "missing.png", "name": "lost"},
    ]
    scene = read(file.glb(), folder=tmp_path)
    assert [(one.name, one.mime_type, one.data) for one in scene.images] == [
        ("inside", "image/png", PNG),
        ("", "image/webp", b"RIFF"),
        ("my wood.jpg", "image/jpeg", b"\xff\xd8\xff..."),
        ("lost", "", b""),
    ]
    assert scene.images[2].properties == {"extras": {"a": 1}, "uri": "my%20wood.jpg"}
    assert scene.notes == ("1 of 4 images could not be had: left empty",)


@pytest.mark.parametrize(
    "uri",
    [
        "../secret.png",
        "/etc/passwd",
        "file:///etc/passwd",
        "http://example.org/a.png",
        "data:image/png;base64,*",
        "x" * 5000,
        "a\0b",
        "\ud800",
        3,
        None,
        {},
    ],
)
def test_images_elsewhere_are_never_read_and_cost_the_mesh_nothing(
    tmp_path: Path, uri: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "secret.png").write_bytes(PNG)
    opened: list[Path] = []
    monkeypatch.setattr(Path, "open", lambda path, *_: opened.append(path))
    for place in (folder, None):
        scene = read(triangle_file(images=[{"uri": uri}]).glb(), folder=place)
        assert scene.images[0].data == b""
        assert len(scene.mesh().faces) == 1
        assert scene.notes == ("1 of 1 images could not be had: left empty",)
    assert opened == []


@pytest.mark.parametrize(
    ("image", "message"),
    [
        ({"bufferView": 9}, r"images\[0\] names bufferViews\[9\]"),
        ({"bufferView": "0"}, r"bufferView of images\[0\] is not a number"),
    ],
)
def test_images_in_views_that_are_not_there_are_refused(image: dict[str, Any], message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        read(triangle_file(images=[image]))


def textured(count: int, side: int) -> bytes:
    """Triangles with a PNG file each, of one colour: small as files, large as pictures."""
    file = GltfFile()
    position = file.accessor([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    for index in range(count):
        picture = PNG[:8] + zlib.compress(bytes(3 * side * side + side), 9)
        file.add("images", {"bufferView": file.view(picture), "mimeType": "image/png"})
        file.add("textures", {"source": index})
        file.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": index}}})
        file.mesh({"attributes": {"POSITION": position}, "material": index})
    return file.shown(*({"mesh": index} for index in range(count))).glb()


def test_textures_take_the_memory_of_their_files_and_no_library() -> None:
    import tracemalloc

    data = textured(20, 512)
    before = set(sys.modules)
    tracemalloc.start()
    scene = read(data)
    assert tracemalloc.get_traced_memory()[1] < 3_000_000  # the pictures would take 15
    tracemalloc.stop()
    assert len(scene.images) == 20
    assert "PIL" not in set(sys.modules) - before
    assert scene.document["textures"] == [{"source": index} for index in range(20)]


def test_images_of_one_view_share_their_bytes() -> None:
    file = triangle_file()
    file.root["images"] = [{"bufferView": file.view(PNG)}] * 1000
    images = read(file).images
    assert all(image.data is images[0].data for image in images)


def test_views_of_images_that_lie_over_one_another_are_refused() -> None:
    file = triangle_file()
    picture = bytes(100_000)
    view = file.root["bufferViews"][file.view(picture)]
    for _ in range(500):
        file.add("images", {"bufferView": file.add("bufferViews", dict(view))})
    assert refusal_peak(file.glb(), "the images up to .* more than the file holds") < 5_000_000


def test_the_rest_of_the_json_is_kept() -> None:
    rest = {
        "asset": {"version": "2.0", "copyright": "x"},
        "textures": [{"sampler": 0}],
        "samplers": [{"wrapS": 33071}],
        "cameras": [{"type": "perspective"}],
        "extras": {"a": None},
        "extensions": {"KHR_lights_punctual": {"lights": []}},
        "extensionsUsed": ["KHR_lights_punctual"],
    }
    scene = read(triangle_file(**rest))
    assert scene.document == rest


def test_what_meshes_say_is_kept_and_what_primitives_say_is_told() -> None:
    file = triangle_file()
    file.root["meshes"][0] |= {"name": "m", "extras": {"a": 1}, "weights": []}
    file.root["meshes"][0]["primitives"][0]["extensions"] = {f"EXT_{i}": {} for i in range(9)}
    scene = read(file)
    assert scene.document["meshes"] == [{"extras": {"a": 1}}]
    assert scene.notes == ("extensions of primitives (EXT_0, EXT_1, EXT_2, EXT_3, EXT_4): left out",)
    assert read(write_gltf(scene, "a.glb").data).document["meshes"] == [{"extras": {"a": 1}}]


def test_animations_are_told_and_left_out() -> None:
    scene = read(triangle_file(animations=[{"channels": [], "samplers": []}] * 2))
    assert scene.notes == ("animations (2): left out",)
    assert "animations" not in scene.document
