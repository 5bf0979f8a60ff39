"""The codecs of triangles and indices of meshopt: every kind of code, streams of meshoptimizer's, damaged ones."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshopt_streams import FIXED_INDICES, FIXED_TRIANGLES, encoded_indices, encoded_triangles
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.meshopt_indices import decode_indices, decode_triangles

WORDS = st.integers(0, 2**32 - 1)
TABLE = bytes.fromhex("007687566778a9866589689801690000")


def triangles(data: bytes, count: int) -> list[list[int]]:
    found: list[list[int]] = decode_triangles(np.frombuffer(data, np.uint8), 3 * count).reshape(-1, 3).tolist()
    return found


def indices(data: bytes, count: int) -> list[int]:
    found: list[int] = decode_indices(np.frombuffer(data, np.uint8), count).tolist()
    return found


@given(st.lists(st.tuples(st.one_of(st.integers(0, 2**29), st.integers(0, 50)), st.integers(0, 1))))
def test_indices_that_are_encoded_are_decoded(pairs: list[tuple[int, int]]) -> None:
    values = [value for value, _ in pairs]
    assert indices(encoded_indices(values, [baseline for _, baseline in pairs]), len(pairs)) == values


@given(st.lists(st.tuples(WORDS, WORDS, WORDS)))
def test_triangles_that_are_encoded_are_decoded(faces: list[tuple[int, int, int]]) -> None:
    explicit = encoded_triangles(faces)
    assert triangles(explicit, len(faces)) == [list(face) for face in faces]


def test_streams_of_meshoptimizer_are_decoded() -> None:
    stream, faces = FIXED_TRIANGLES
    found = triangles(base64.b64decode(stream), len(faces))
    for one, face in zip(found, faces, strict=True):  # its encoder may begin a triangle at another corner
        assert face in ([*one], [*one[1:], one[0]], [one[2], *one[:2]])
    stream_of_indices, values = FIXED_INDICES
    assert indices(base64.b64decode(stream_of_indices), len(values)) == values


@pytest.mark.parametrize(
    ("codes", "data", "faces"),
    [
        ("f0", b"", [[0, 1, 2]]),
        ("f0 00", b"", [[0, 1, 2], [0, 2, 3]]),
        ("f0 10", b"", [[0, 1, 2], [2, 1, 3]]),
        ("f0 20", b"", [[0, 1, 2], [1, 0, 3]]),
        ("f0 02", b"", [[0, 1, 2], [0, 2, 0]]),
        ("f0 0e", b"", [[0, 1, 2], [0, 2, 1]]),
        ("ff 0d", b"\xff\x0a\x02\x02", [[5, 6, 7], [5, 7, 6]]),
        ("ff 0e", b"\xff\x0a\x02\x02", [[5, 6, 7], [5, 7, 8]]),
        ("f0 0f", b"\x12", [[0, 1, 2], [0, 2, 9]]),
        ("f0 fe", b"\x12", [[0, 1, 2], [3, 2, 1]]),
        ("f0 fe", b"\x00", [[0, 1, 2], [0, 1, 2]]),
        ("f0 ff", b"\x01\x10", [[0, 1, 2], [8, 3, 2]]),
        ("f0 f1", b"", [[0, 1, 2], [3, 0, 4]]),
    ],
)
def test_each_kind_of_code(codes: str, data: bytes, faces: list[list[int]]) -> None:
    table = bytes([0x00, 0x30]) + bytes(14)
    assert triangles(b"\xe1" + bytes.fromhex(codes) + data + table, len(faces)) == faces


@pytest.mark.parametrize(
    ("stream", "count", "message"),
    [
        (b"", 1, "does not say triangles"),
        (b"\xe0" + bytes(40), 1, "does not say triangles"),
        (b"\xe1" + bytes(10), 1, "1 triangles take at least 18 bytes, but there are 11"),
        (b"\xe1" + bytes(40), 10**12, "1000000000000 triangles take at least"),
        (b"\xe1\x00" + bytes(16), 1, "leans on an edge or vertex that did not come"),
        (b"\xe1\xf0\xb1" + bytes(16), 2, "did not come"),
        (b"\xe1\xf0\x07" + bytes(16), 2, "did not come"),
        (b"\xe1\xf1" + b"\0\x30" + bytes(14), 1, "did not come"),
        (b"\xe1\xff" + bytes(16), 1, "cut short"),
        (b"\xe1\xff\xff\xff\xff\xff\xff\xff\xff" + bytes(16), 1, "longer than five bytes"),
        (b"\xe1\xf0\0" + bytes(16), 1, "1 bytes follow the last triangle"),
        (b"\xe1\xf0" + bytes(15) + b"\1", 1, "table of codes"),
        (b"\xe1\xf0" + b"\x0f" + bytes(15), 1, "table of codes"),
        (b"\xe1\xf0" + b"\xf0" + bytes(15), 1, "table of codes"),
    ],
)
def test_damaged_triangles_are_refused(stream: bytes, count: int, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        triangles(stream, count)


@pytest.mark.parametrize(
    ("stream", "count", "message"),
    [
        (b"", 1, "does not say indices"),
        (b"\xd0" + bytes(40), 1, "does not say indices"),
        (b"\xd1" + bytes(40), 10**12, "1000000000000 indices take at least"),
        (b"\xd1\2\2" + bytes(4), 3, "3 indices take at least 8 bytes"),
        (b"\xd1\2\2\2" + bytes(4), 2, "3 numbers for 2 indices"),
        (b"\xd1\2\x82\x82" + bytes(4), 3, "1 numbers for 3 indices"),
        (b"\xd1\2\x82" + bytes(4), 1, "or bytes after them"),
        (b"\xd1\x80\x80\x80\x80\x80\2" + bytes(4), 1, "longer than five bytes"),
        (b"\xd1\2" + bytes(4), 0, "1 numbers for 0 indices"),
    ],
)
def test_damaged_indices_are_refused(stream: bytes, count: int, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        indices(stream, count)


def test_streams_cut_short_anywhere_are_refused() -> None:
    faces = [[0, 1, 2], [2, 1, 300], [70000, 5, 4]]
    for length in range(len(encoded_triangles(faces))):
        with pytest.raises(MeshFileError):
            triangles(encoded_triangles(faces)[:length], 3)
    values = [1, 500, 2, 70000]
    for length in range(len(encoded_indices(values, [0, 1, 0, 1]))):
        with pytest.raises(MeshFileError):
            indices(encoded_indices(values, [0, 1, 0, 1])[:length], 4)


@given(st.binary(max_size=60), st.integers(0, 20))
def test_any_bytes_give_indices_or_a_reason(data: bytes, count: int) -> None:
    for head, decode in ((b"\xe1", triangles), (b"\xd1", indices)):
        for tail in (b"", TABLE):
            try:
                assert len(decode(head + data + tail, count)) == count
            except MeshFileError as error:
                assert str(error)
