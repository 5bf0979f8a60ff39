"""Buffer views that meshopt compresses: read as what they stand for; damaged or odd ones named by their extension."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gltf_files import AREA, PYRAMID, PYRAMID_FACES, GltfFile, area, read, read_mesh, refusal_peak
from meshopt_streams import encoded_attributes, encoded_indices, encoded_triangles
from meshtide_codec.errors import MeshFileError

ATTRIBUTES = {"byteStride": 12, "mode": "ATTRIBUTES", "count": 5}
TRIANGLES = {"byteStride": 2, "mode": "TRIANGLES", "count": 18}


def compressed(
    name: str = "EXT_meshopt_compression",
    *,
    version: int = 0,
    mode: str = "TRIANGLES",
    first: dict[str, Any] | None = None,
    second: dict[str, Any] | None = None,
    damage: bytes | None = None,
) -> GltfFile:
    """The pyramid, without any bytes that are not compressed."""
    file = GltfFile()
    flat = PYRAMID_FACES.reshape(-1).tolist()
    indices = encoded_triangles(PYRAMID_FACES.tolist()) if mode == "TRIANGLES" else encoded_indices(flat, [0] * 18)
    points = encoded_attributes(PYRAMID.view(np.uint8), version, None)
    streams = [points if damage is None else damage, indices]
    sizes, given = [60, 36], [ATTRIBUTES | (first or {}), TRIANGLES | {"mode": mode} | (second or {})]
    for stream, size, more in zip(streams, sizes, given, strict=True):
        row = {"buffer": 0, "byteOffset": len(file.binary), "byteLength": len(stream), **more}
        file.binary += stream
        file.add("bufferViews", {"buffer": 1, "byteOffset": 0, "byteLength": size, "extensions": {name: row}})
    file.add("accessors", {"bufferView": 0, "componentType": 5126, "count": 5, "type": "VEC3"})
    file.add("accessors", {"bufferView": 1, "componentType": 5123, "count": 18, "type": "SCALAR"})
    file.root["buffers"] = [
        {"byteLength": len(file.binary)},
        {"byteLength": 96, "extensions": {name: {"fallback": True}}},
    ]
    file.root["extensionsRequired"] = [name]
    file.mesh({"attributes": {"POSITION": 0}, "indices": 1})
    return file.shown({"mesh": 0})


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
@pytest.mark.parametrize("version", [0, 1])
@pytest.mark.parametrize("mode", ["TRIANGLES", "INDICES"])
def test_compressed_views_are_read(name: str, version: int, mode: str) -> None:
    mesh = read_mesh(compressed(name, version=version, mode=mode))
    assert np.array_equal(mesh.vertices, PYRAMID)
    assert np.array_equal(mesh.faces, PYRAMID_FACES)
    assert area(mesh) == pytest.approx(AREA)


def test_a_filter_is_applied() -> None:
    file = compressed()
    mantissas = (PYRAMID * 2).astype("<i8") & 0xFFFFFF | 0xFF << 24  # halves
    stream = encoded_attributes(mantissas.astype("<u4").view(np.uint8), 0, None)
    row = file.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]
    row |= {"filter": "EXPONENTIAL", "byteOffset": len(file.binary), "byteLength": len(stream)}
    file.binary += stream
    file.root["buffers"][0]["byteLength"] = len(file.binary)
    assert np.array_equal(read_mesh(file).vertices, PYRAMID)


def test_sparse_indices_may_be_compressed_and_views_are_decoded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    from meshtide_codec.mesh_files.gltf import meshopt

    counted = []
    decode = meshopt.decode_attributes
    monkeypatch.setattr(meshopt, "decode_attributes", lambda *args: counted.append(1) or decode(*args))
    file = compressed()
    file.root["meshes"][0]["primitives"][0]["attributes"]["_OTHER"] = file.add("accessors", file.root["accessors"][0])
    assert len(read_mesh(file).attributes) == 1
    assert len(counted) == 1


@pytest.mark.parametrize(
    "damage",
    [b"\xa0" + bytes(10), b"\xb0" * 61, b"", b"\xa0" + b"\xff" * 80],
    ids=["short", "other", "empty", "filler"],
)
@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_damaged_streams_name_their_extension(name: str, damage: bytes) -> None:
    with pytest.raises(MeshFileError, match=f"a stream of {name} is damaged"):
        read(compressed(name, damage=damage))


@pytest.mark.parametrize(
    ("first", "message"),
    [
        ({"mode": "SPIRALS"}, "unknown mode: SPIRALS"),
        ({"mode": 3}, "unknown mode: 3"),
        ({"filter": "SEPIA"}, "unknown filter: SEPIA"),
        ({"filter": []}, "unknown filter: a list"),
        ({"byteStride": 10}, "have no stride of 10 bytes"),
        ({"byteStride": 260}, "have no stride of 260 bytes"),
        ({"byteStride": 0}, "have no stride of 0 bytes"),
        ({"filter": "OCTAHEDRAL"}, "ATTRIBUTES with filter OCTAHEDRAL have no stride of 12"),
        ({"filter": "QUATERNION", "byteStride": 4}, "have no stride of 4"),
        ({"mode": "INDICES"}, "INDICES with filter NONE have no stride of 12"),
        ({"mode": "TRIANGLES", "byteStride": 4, "count": 7}, "7 indices are not whole triangles"),
        ({"mode": "INDICES", "byteStride": 4, "filter": "COLOR"}, "INDICES with filter COLOR"),
        ({"count": 4}, "holds 4 elements of 12 bytes, but the view has 60"),
        ({"count": 1 << 40}, "but the view has 60"),
        ({"count": None}, "count of .* is not a number"),
        ({"byteLength": 1 << 40}, "lies outside of its buffer"),
        ({"buffer": 1}, r"buffers\[1\] has no bytes: it stands for readers without the compression"),
        ({"buffer": 5}, r"names buffers\[5\]"),
    ],
)
def test_odd_descriptions_are_refused(first: dict[str, Any], message: str) -> None:
    with pytest.raises(MeshFileError, match=message) as error:
        read(compressed(first=first))
    assert "meshopt_compression" in str(error.value) or "buffers" in str(error.value)


def test_zeros_in_few_bytes_do_not_take_more_than_a_file_may_make() -> None:
    """Version 1 says 256 zeros in a bit or two: a megabyte may claim a gigabyte."""
    count = 1 << 25
    stream = b"\xa1" + b"\xaa" * (count // 256) + bytes(23) + b"\0"
    file = compressed("KHR_meshopt_compression", damage=stream, first={"byteStride": 4, "count": count})
    file.root["bufferViews"][0]["byteLength"] = 4 * count
    file.root["bufferViews"][0]["byteStride"] = 4
    file.root["accessors"][0] |= {"count": count, "componentType": 5121}
    data = file.glb()
    message = "KHR_meshopt_compression of bufferViews.0. makes 134217728 bytes, more than a file of"
    assert refusal_peak(data, message) < 3_000_000
