"""The JSON of glTF files: versions, bounds, and values that are not what they should be."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gltf_files import GltfFile, glb, pyramid_file, read, triangle_file
from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.gltf.document import LARGEST_LIST, integer, numbers, parsed, rows, shown


@pytest.mark.parametrize(
    ("asset", "message"),
    [
        ({"version": "1.0"}, r"of glTF 1\.0; version 2\.0 is read"),
        ({"version": "3.0"}, r"of glTF 3\.0"),
        ({"version": "2.0", "minVersion": "2.1"}, r"of glTF 2\.1"),
        ({"version": 2}, "asset.version is not a version: 2"),
        ({"version": "two"}, "asset.version is not a version: two"),
        ({"version": "²"}, "asset.version is not a version"),
        ([], "asset of the file is not an object: a list"),
    ],
)
def test_other_versions_are_refused_by_name(asset: Any, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        read(triangle_file(asset=asset))


@pytest.mark.parametrize("asset", [{"version": "2.0"}, {"version": "2.1"}, {"version": "2.0", "minVersion": "2.0"}, {}])
def test_versions_of_two_are_read(asset: dict[str, str]) -> None:
    assert len(read(triangle_file(asset=asset)).mesh().faces) == 1


def test_byte_order_mark_and_padding_are_passed_over() -> None:
    data = b"\xef\xbb\xbf" + pyramid_file().gltf() + b"\0\0 \n"
    assert len(read(data, ".gltf").mesh().faces) == 6


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"[]", "not an object"),
        (b'{"a"', "cannot be read"),
        (b"\xff\xfe{", "cannot be read"),
        (b"[" * 200_000, "nested too deeply"),
        (b'{"a": ' + b"9" * 5000 + b"}", "cannot be read"),
        (b'{"meshes": {}}', "meshes of the file is not a list of objects"),
        (b'{"meshes": [3]}', "meshes of the file is not a list of objects"),
        (b"{}", "there are no meshes in it"),
    ],
)
def test_what_is_no_gltf_is_refused(text: bytes, message: str) -> None:
    for data, suffix in ((text, ".gltf"), (glb(text), ".glb")):
        with pytest.raises(MeshFileError, match=message):
            read(data, suffix)


def test_long_json_is_refused_before_it_is_read() -> None:
    limits = FileLimits(json_bytes=1000)
    with pytest.raises(MeshFileError, match="claims 1001 bytes; 1000 are the most"):
        parsed(b" " * 1001, limits)


def test_endless_lists_are_refused() -> None:
    row: dict[str, Any] = {}
    with pytest.raises(MeshFileError, match=f"{LARGEST_LIST} are the most"):
        rows({"nodes": [row] * (LARGEST_LIST + 1)}, "nodes", "the file")


@pytest.mark.parametrize("value", [-1, 1.5, True, None, "3", [3], {}, 1 << 53, float("inf"), float("nan")])
def test_what_is_no_count_is_refused(value: Any) -> None:
    with pytest.raises(MeshFileError, match="count of x is not a number from 0 on"):
        integer({"count": value}, "count", "x")


@pytest.mark.parametrize("value", [[1, 2], [1, 2, "3"], [1, 2, None], [1, 2, 1 << 2000], [1, 2, True], 3, "abc"])
def test_what_are_no_numbers_is_refused(value: Any) -> None:
    with pytest.raises(MeshFileError, match="scale of x"):
        numbers({"scale": value}, "scale", "x", (1, 1, 1))


def test_values_are_shown_in_one_short_line() -> None:
    assert shown("\x1b[31m\n" + "é" * 100) == "\\x1b[31m\\n" + "\\xe9" * 44
    assert shown({"a": "b"}) == "an object"


def test_not_a_number_in_a_place_that_does_not_matter_is_passed_over() -> None:
    data = triangle_file().gltf().replace(b'"count": 3', b'"count": 3, "min": [NaN, Infinity]')
    assert len(read(data, ".gltf").mesh().faces) == 1


def places_in(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The way to each value within JSON."""
    inner: Any = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(place for key, item in inner for place in places_in(item, (*path, key)))]


def rich_file() -> GltfFile:
    """A file that has something of everything."""
    file = GltfFile()
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    position = file.accessor(corners, "<f4")
    names = ["NORMAL", "TEXCOORD_0", "JOINTS_0", "WEIGHTS_0"]
    tables = [[[0, 0, 1]] * 4, [[0, 1]] * 4, [[0, 0, 0, 0]] * 4, [[1, 0, 0, 0]] * 4]
    types = ["<f4", "<f4", "<u1", "<f4"]
    attributes = {name: file.accessor(table, dtype) for name, table, dtype in zip(names, tables, types, strict=True)}
    indices = file.accessor([0, 1, 2, 0, 1, 3], "<u2")
    sparse = {"count": 1, "indices": {"bufferView": 5, "componentType": 5123}, "values": {"bufferView": 0}}
    target = file.add("accessors", {"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse})
    file.mesh(
        {
            "attributes": {"POSITION": position, **attributes},
            "indices": indices,
            "mode": 4,
            "material": 0,
            "targets": [{"POSITION": target}],
            "extensions": {},
        },
        weights=[0.5],
    )
    file.add("materials", {"name": "m"})
    file.add("images", {"uri": "data:image/png;base64,AAAA"})
    file.add("images", {"bufferView": 0, "mimeType": "image/png"})
    file.add("skins", {"joints": [1], "inverseBindMatrices": file.accessor([[1, 0, 0, 0] * 4], "<f4")})
    file.add("animations", {"channels": [], "samplers": []})
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": position}}}
    file.shown(
        {"mesh": 0, "skin": 0, "children": [1]},
        {"translation": [1, 2, 3], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], "extensions": instancing},
    )
    file.root["scenes"][0]["nodes"] = [0, 2]
    file.root["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    file.root["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    file.glb()
    return file


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 1 << 40) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["mode", "uri", "mesh"]), inner),
    max_leaves=4,
)
PLACES = places_in(rich_file().root)[1:]


def test_the_rich_file_is_read() -> None:
    scene = read(rich_file())
    assert len(scene.mesh().faces) == 2 + 4 * 2
    assert len(scene.geometries) == 2


@given(st.sampled_from(PLACES), st.integers(0, 5) | JSON)
@settings(max_examples=250)
def test_any_value_anywhere_is_taken_or_refused_with_a_reason(place: tuple[Any, ...], value: Any) -> None:
    file = rich_file()
    *way, last = place
    inner: Any = file.root
    for key in way:
        inner = inner[key]
    inner[last] = value
    try:
        read(file, limits=FileLimits(vertices=10_000, faces=10_000)).mesh()
    except MeshError as error:
        assert str(error)
