"""Accessors: types, strides, sparse values, and claims that no bytes stand behind."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gltf_files import PYRAMID, GltfFile, read, read_mesh, refusal_peak, triangle_file
from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.gltf.accessors import Accessors, Table, real
from meshtide_codec.mesh_files.gltf.buffers import Buffers
from meshtide_codec.mesh_files.gltf.document import Document
from meshtide_codec.mesh_files.source import Source

TYPES = ["<i1", "<u1", "<i2", "<u2", "<u4", "<f4"]


def accessors(file: GltfFile) -> Accessors:
    data = file.glb()
    document = Document(file.root)
    return Accessors(document, Buffers(document, memoryview(bytes(file.binary)), Source("a", "", data), FileLimits()))


@given(st.sampled_from(TYPES), st.integers(1, 4), st.integers(0, 9), st.integers(0, 5), st.booleans())
def test_tables_of_any_type_and_stride_are_read(
    dtype: str, width: int, count: int, more: int, normalized: bool
) -> None:
    values = (np.arange(count * width) * 7 - 20).reshape(count, width).astype(dtype)
    file = GltfFile()
    file.view(b"x" * 4)
    size = values.dtype.itemsize * width
    index = file.accessor(values, stride=size + more if more and count else 0, normalized=normalized)
    table = accessors(file).array(index, "x")
    assert table.dtype == values.dtype
    assert np.array_equal(table, values)
    assert accessors(file).form(index, "x").normalized is (normalized and values.dtype.kind != "f")


def test_what_stands_close_is_not_copied_and_what_is_apart_is_aligned() -> None:
    file = GltfFile()
    close, apart = file.accessor(PYRAMID), file.accessor(PYRAMID, stride=20)
    odd = file.view(b"\0" + PYRAMID.tobytes())
    shifted = file.add("accessors", file.root["accessors"][close] | {"bufferView": odd, "byteOffset": 1})
    found = accessors(file)
    whole = found.buffers.buffer(0, "x")
    assert np.shares_memory(found.array(close, "x"), whole)
    for index in (apart, shifted):
        assert np.array_equal(found.array(index, "x"), PYRAMID)
        assert found.array(index, "x").flags.c_contiguous
        assert found.array(index, "x").flags.aligned


@pytest.mark.parametrize(
    ("kind", "dtype", "rows"),
    [("MAT2", "<i1", [0, 1, 4, 5]), ("MAT3", "<u1", [0, 1, 2, 4, 5, 6, 8, 9, 10]), ("MAT4", "<u1", list(range(16)))],
)
def test_columns_of_matrices_are_padded(kind: str, dtype: str, rows: list[int]) -> None:
    file = GltfFile()
    size = {"MAT2": 8, "MAT3": 12, "MAT4": 16}[kind]
    view = file.view(bytes(range(2 * size)))
    component = 5120 if dtype == "<i1" else 5121
    index = file.add("accessors", {"bufferView": view, "componentType": component, "count": 2, "type": kind})
    assert accessors(file).array(index, "x").tolist() == [rows, [size + row for row in rows]]


@pytest.mark.parametrize(
    ("dtype", "ends"), [("i1", (-128, 127)), ("i2", (-32768, 32767)), ("u1", (0, 255)), ("u2", (0, 65535))]
)
def test_normalized_integers_end_at_one(dtype: str, ends: tuple[int, int]) -> None:
    values = np.array([ends], dtype)
    assert Table(values, normalized=True).real().tolist() == [[-1.0 if ends[0] else 0.0, 1.0]]
    assert Table(values, normalized=False).real().tolist() == [[float(end) for end in ends]]
    assert real(np.array([[-3.0]], "<f4"), normalized=True).tolist() == [[-3.0]]


def sparse_file(count: int, chosen: Any, *, backed: bool, dtype: str = "<u2") -> tuple[GltfFile, int]:
    file = GltfFile()
    base = np.arange(3 * count, dtype="<f4").reshape(count, 3)
    index = file.accessor(base)
    indices = file.view(np.array(chosen, dtype).tobytes())
    values = file.view(np.full((len(chosen), 3), 7, "<f4").tobytes())
    component = {"<u1": 5121, "<u2": 5123, "<u4": 5125}[dtype]
    file.root["accessors"][index]["sparse"] = {
        "count": len(chosen),
        "indices": {"bufferView": indices, "componentType": component},
        "values": {"bufferView": values},
    }
    if not backed:
        del file.root["accessors"][index]["bufferView"]
    return file, index


@pytest.mark.parametrize("dtype", ["<u1", "<u2", "<u4"])
@pytest.mark.parametrize("backed", [True, False])
def test_sparse_values_replace_some(dtype: str, backed: bool) -> None:
    file, index = sparse_file(9, [2, 5], backed=backed, dtype=dtype)
    expected = np.arange(27, dtype="<f4").reshape(9, 3) * backed
    expected[[2, 5]] = 7
    found = accessors(file)
    assert np.array_equal(found.array(index, "x"), expected)
    assert np.array_equal(found.buffers.view(0, "x").view("<f4"), np.arange(27))  # the file's own bytes stay


def test_sparse_indices_out_of_range_are_refused() -> None:
    file, index = sparse_file(9, [2, 9], backed=True)
    with pytest.raises(MeshFileError, match=r"accessors\[0\] replaces element 9, but has 9"):
        accessors(file).array(index, "x")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 10}, r"accessors\[0\] replaces 10 of its 9 elements"),
        ({"count": 3}, r"sparse indices of accessors\[0\] claims 3 elements, more than its view holds"),
        ({"indices": {"bufferView": 1, "componentType": 5126}}, "of an unknown type: 5126"),
        ({"indices": {"componentType": 5123}}, "has no bufferView"),
        ({"values": {"bufferView": 1}}, r"sparse values of accessors\[0\] claims 2 elements"),
        ({"values": []}, "values of sparse of accessors.0. is not an object"),
    ],
)
def test_sparse_claims_are_held_against_their_bytes(changes: dict[str, Any], message: str) -> None:
    file, index = sparse_file(9, [2, 5], backed=True)
    file.root["accessors"][index]["sparse"] |= changes
    with pytest.raises(MeshFileError, match=message):
        accessors(file).array(index, "x")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 4}, r"accessors\[0\] claims 4 elements, more than its view holds: they end at byte 48"),
        ({"byteOffset": 1}, "they end at byte 37"),
        ({"byteOffset": 10**12}, "more than its view holds"),
        ({"count": 10**12}, "claims 1000000000000 elements"),
        ({"count": -1}, r"count of accessors\[0\] is not a number from 0 on: -1"),
        ({"type": "VEC9"}, r"accessors\[0\] is of an unknown type: 5126, VEC9"),
        ({"type": ["VEC3"]}, "of an unknown type: 5126, a list"),
        ({"componentType": 5124}, "of an unknown type: 5124"),
        ({"bufferView": None}, r"bufferView of accessors\[0\] is not a number"),
        ({"bufferView": 7}, r"accessors\[0\] names bufferViews\[7\]; the file has 1 bufferViews"),
        ({"count": 10**12, "bufferView": None}, "not a number"),
    ],
)
def test_claims_are_held_against_the_bytes(changes: dict[str, Any], message: str) -> None:
    file = triangle_file()
    file.root["accessors"][0] |= changes
    with pytest.raises(MeshFileError, match=message):
        read(file)


def test_a_stride_below_the_element_is_refused() -> None:
    file = triangle_file()
    file.root["bufferViews"][0]["byteStride"] = 8
    with pytest.raises(MeshFileError, match="elements of 12 bytes, one for each 8 of its view"):
        read(file)


def test_positions_and_indices_without_bytes_are_refused() -> None:
    file = triangle_file()
    del file.root["accessors"][0]["bufferView"]
    file.root["accessors"][0]["count"] = 10**12
    with pytest.raises(MeshFileError, match=r"accessors\[0\], the positions .* no bytes stand behind it"):
        read(file)
    file = triangle_file()
    primitive = file.root["meshes"][0]["primitives"][0]
    primitive["indices"] = file.add("accessors", {"componentType": 5125, "count": 3, "type": "SCALAR"})
    with pytest.raises(MeshFileError, match=r"accessors\[1\], the indices .* has no bytes behind it"):
        read(file)


@pytest.mark.parametrize("count", [10**7, 10**12])
def test_little_that_claims_much_takes_no_memory(count: int) -> None:
    file, index = sparse_file(9, [2], backed=False)
    file.root["accessors"][index]["count"] = count
    file.mesh({"attributes": {"POSITION": index}})
    data = file.shown({"mesh": 0}).glb()
    assert refusal_peak(data, "the most that is read|more than a file of") < 1_000_000


def test_accessors_that_overlap_do_not_multiply_the_file() -> None:
    """Each takes its own copy of one view, as its elements stand apart; together they may not be much more than it."""
    file = GltfFile()
    first = file.accessor(np.zeros((30_000, 3), "<f4"), stride=16)
    row = file.root["accessors"][first]
    more = {f"_{i}": file.add("accessors", dict(row)) for i in range(200)}
    file.mesh({"attributes": {"POSITION": first, **more}})
    data = file.shown({"mesh": 0}).glb()
    assert refusal_peak(data, "more than a file of") < 110 * len(data)


def test_quantized_positions_are_plain_or_normalized() -> None:
    for normalized, scale in ((False, 1.0), (True, 1 / 32767)):
        file = GltfFile()
        values = np.array([[0, 0, 0], [32767, 0, 0], [0, -32768, 0]], "<i2")
        file.mesh({"attributes": {"POSITION": file.accessor(values, stride=8, normalized=normalized)}})
        file.shown({"mesh": 0}).root["extensionsRequired"] = ["KHR_mesh_quantization"]
        expected = values.astype(float) * scale
        assert np.array_equal(read_mesh(file).vertices, np.maximum(expected, -1) if normalized else expected)
