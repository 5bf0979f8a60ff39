"""The buffer that is written: alignment, strides, types of indices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.gltf.accessors import Accessors
from meshtide_codec.mesh_files.gltf.buffers import Buffers
from meshtide_codec.mesh_files.gltf.document import Document
from meshtide_codec.mesh_files.gltf.write_buffer import Buffer
from meshtide_codec.mesh_files.source import Source


def reader(buffer: Buffer) -> Accessors:
    data = buffer.data()
    root = {
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(data)}],
    }
    document = Document(root)
    return Accessors(document, Buffers(document, memoryview(data), Source("a", "", data), FileLimits()))


@given(
    st.lists(
        st.tuples(st.sampled_from(["i1", "u1", ">i2", "u2", "u4", "f4"]), st.integers(1, 4), st.integers(1, 9)),
        min_size=1,
        max_size=5,
    )
)
def test_what_is_put_in_is_read_out_and_aligned(shapes: list[tuple[str, int, int]]) -> None:
    buffer = Buffer()
    tables = [np.arange(width * count).reshape(count, width).astype(dtype) for dtype, width, count in shapes]
    for table in tables:
        buffer.vertices(table, normalized=table.dtype.kind != "f")
    found = reader(buffer)
    for index, table in enumerate(tables):
        assert np.array_equal(found.array(index, "x"), table)
        assert found.form(index, "x").normalized is (table.dtype.kind != "f")
    assert all(view["byteOffset"] % 4 == 0 and view.get("byteStride", 4) % 4 == 0 for view in buffer.views)
    assert all(view.get("byteStride", 4) >= 4 for view in buffer.views)


@pytest.mark.parametrize(("largest", "size"), [(0, 2), (65534, 2), (65535, 4), (70000, 4)])
def test_indices_take_as_few_bytes_as_they_fit(largest: int, size: int) -> None:
    buffer = Buffer()
    index = buffer.indices(np.array([[0, 0, largest]]))
    assert buffer.views[0]["byteLength"] == 3 * size
    assert buffer.views[0]["target"] == 34963
    assert reader(buffer).array(index, "x").reshape(-1).tolist() == [0, 0, largest]


def test_bounds_are_those_of_the_numbers_that_are_written() -> None:
    buffer = Buffer()
    buffer.vertices(np.array([[0.1, 5], [-2, 0.2]], np.float32), bounds=True)
    assert buffer.accessors[0]["min"] == [-2.0, float(np.float32(0.2))]
    assert buffer.accessors[0]["max"] == [float(np.float32(0.1)), 5.0]
    assert buffer.views[0]["target"] == 34962


def test_views_stand_one_after_the_other() -> None:
    buffer = Buffer()
    assert buffer.view(b"12345") == 0
    assert buffer.view(b"6", byteStride=4) == 1
    assert buffer.data() == b"12345\0\0\0" + b"6\0\0\0"
    assert buffer.views[1] == {"buffer": 0, "byteOffset": 8, "byteLength": 1, "byteStride": 4}
