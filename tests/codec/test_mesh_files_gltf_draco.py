"""Draco streams: decoded where the library is, refused with the remedy where not, and held against their claims."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from gltf_files import AREA, PYRAMID, PYRAMID_FACES, GltfFile, area, read, read_mesh
from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.gltf.draco import counts, decode

DracoPy = pytest.importorskip("DracoPy")
NAME = "KHR_draco_mesh_compression"
NORMALS = np.array([[0, 0, 1]] * 4 + [[1, 0, 0]], "<f4")
COORDINATES = np.arange(10, dtype="<f4").reshape(5, 2) / 10


def stream(**more: Any) -> bytes:
    data: bytes = DracoPy.encode(PYRAMID, PYRAMID_FACES.astype("<u4"), quantization_bits=14, **more)
    return data


def compressed(
    data: bytes, ids: dict[str, int], *, fallback: bool = False, required: bool = True, **more: tuple[Any, str]
) -> GltfFile:
    file = GltfFile()
    view = file.view(data)
    if fallback:
        attributes = {"POSITION": file.accessor(PYRAMID)}
        indices = file.accessor(PYRAMID_FACES.reshape(-1), "<u2")
    else:
        attributes = {"POSITION": file.add("accessors", {"componentType": 5126, "count": 5, "type": "VEC3"})}
        indices = file.add("accessors", {"componentType": 5125, "count": 18, "type": "SCALAR"})
    for name, (row, dtype) in more.items():
        attributes[name] = file.accessor(row, dtype)
        del file.root["accessors"][attributes[name]]["bufferView"]
    extension = {NAME: {"bufferView": view, "attributes": ids}}
    file.mesh({"attributes": attributes, "indices": indices, "extensions": extension})
    file.root |= {"extensionsUsed": [NAME]} | ({"extensionsRequired": [NAME]} if required else {})
    return file.shown({"mesh": 0})


def test_positions_and_faces_are_decoded() -> None:
    mesh = read_mesh(compressed(stream(), {"POSITION": 0}))
    assert (len(mesh.vertices), len(mesh.faces)) == (5, 6)
    assert area(mesh) == pytest.approx(AREA, rel=1e-3)


def test_attributes_are_found_by_their_numbers_and_get_the_accessors_types() -> None:
    data = stream(tex_coord=COORDINATES.astype(float), normals=NORMALS.astype(float), preserve_order=True, colors=None)
    found = {one["attribute_type"]: one["unique_id"] for one in DracoPy.decode(data).attributes}
    ids = {"POSITION": found[0], "NORMAL": found[1], "TEXCOORD_0": found[3]}
    mesh = read_mesh(compressed(data, ids, NORMAL=(NORMALS, "<f4"), TEXCOORD_0=(COORDINATES, "<f4")))
    by_name = {one.name: one for one in mesh.attributes}
    nearest = np.abs(mesh.vertices[:, None] - PYRAMID).sum(axis=2).argmin(axis=1)
    assert np.allclose(by_name["TEXCOORD_0"].values, COORDINATES[nearest], atol=1e-3)
    assert np.allclose(by_name["NORMAL"].values, NORMALS[nearest], atol=2e-2)


def test_integers_stay_integers() -> None:
    joints = np.array([[1, 2, 3, 4]] * 5, "u1")
    data = DracoPy.encode(PYRAMID, PYRAMID_FACES.astype("<u4"), generic_attributes={7: joints})
    positions = next(one["unique_id"] for one in DracoPy.decode(data).attributes if one["attribute_type"] == 0)
    mesh = read_mesh(compressed(data, {"POSITION": positions, "JOINTS_0": 7}, JOINTS_0=(joints, "u1")))
    assert mesh.attributes[0].values.dtype == np.uint8
    assert mesh.attributes[0].values.tolist() == joints.tolist()


@pytest.mark.parametrize("options", [{}, {"compression_level": 0}, {"compression_level": 10}, {"preserve_order": True}])
@pytest.mark.parametrize("metadata", [True, False])
def test_counts_are_read_without_decoding(options: dict[str, Any], metadata: bool) -> None:
    data = stream(create_metadata=metadata, **options)
    vertices, faces = counts(data)
    assert faces == 6
    assert vertices <= 5
    assert len(decode(data).faces) == 6


def test_without_the_library_the_error_names_extension_and_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    for required in (True, False):
        with pytest.raises(MeshFileError, match=rf"{NAME}.*pip install 'meshtide\[gltf\]'"):
            read(compressed(stream(), {"POSITION": 0}, required=required))


def test_without_the_library_the_uncompressed_primitive_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    file = compressed(stream(), {"POSITION": 0}, fallback=True, required=False)
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    assert np.array_equal(read_mesh(file).vertices, PYRAMID)


def test_claims_are_held_against_the_limits_before_decoding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DracoPy, "decode", lambda _: pytest.fail("decoded"))
    file = compressed(stream(), {"POSITION": 0})
    with pytest.raises(MeshFileError, match="claims 6 faces; 5 are the most"):
        read(file, limits=FileLimits(faces=5))
    head = b"DRACO\2\2\1\1\0\0\0"  # edgebreaker; then vertices and faces
    with pytest.raises(MeshFileError, match="makes 2400000000 bytes, more than a file of"):
        limits = FileLimits(vertices=10**9, faces=10**9)
        read(compressed(head + b"\x80\xc2\xd7\x2f" * 2 + bytes(100), {"POSITION": 0}), limits=limits)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"DRACO", "cut short within its header"),
        (b"DRACK" + bytes(50), "does not begin with DRACO"),
        (b"DRACO\2\2\0\0" + bytes(50), "is not a mesh"),
        (b"DRACO\7\2\1\0" + bytes(50), "unknown version 7.2"),
        (b"DRACO\2\2\1\0\0\0" + b"\xff" * 50, "a number that does not end"),
        (b"DRACO\2\2\1\0\0\x80" + b"\0" + b"\0\1\1a" * 100, "nested more than 16 times"),
        (b"DRACO\2\2\1\1\0\0\0" + b"\5\6" + b"\xff" * 50, "is damaged"),
    ],
)
def test_damaged_streams_are_refused_by_the_name_of_the_extension(data: bytes, message: str) -> None:
    with pytest.raises(MeshFileError, match=f"{NAME}.*{message}"):
        read(compressed(data, {"POSITION": 0}))


def test_a_stream_cut_short_anywhere_is_refused() -> None:
    data = stream()
    for length in range(1, len(data) - 4):
        with pytest.raises(MeshFileError, match=NAME):
            read(compressed(data[:length], {"POSITION": 0}))


@pytest.mark.parametrize(
    ("ids", "message"),
    [
        ({}, f"{NAME} of .* has no POSITION"),
        ({"POSITION": 9}, "holds no attribute 9, its POSITION"),
        ({"POSITION": -1}, "is not a number from 0 on"),
    ],
)
def test_attributes_that_are_not_there_are_refused(ids: dict[str, int], message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        read(compressed(stream(), ids))
