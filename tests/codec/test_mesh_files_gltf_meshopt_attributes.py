"""The attribute codec of meshopt, held against an encoder of the tests' own and against streams of meshoptimizer's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshopt_streams import encoded_attributes, fixed_attributes
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.meshopt_attributes import decode_attributes

if TYPE_CHECKING:
    from numpy.typing import NDArray


def decoded(data: bytes, count: int, stride: int) -> NDArray[np.uint8]:
    return decode_attributes(np.frombuffer(data, np.uint8), count, stride)


def table(seed: int, count: int, stride: int, kind: str) -> NDArray[np.uint8]:
    rng = np.random.default_rng(seed)
    match kind:
        case "noise":
            return rng.integers(0, 256, (count, stride)).astype(np.uint8)
        case "steps":
            return np.cumsum(rng.integers(-2, 3, (count, stride)), axis=0).astype(np.uint8)
        case "rare steps":
            return np.cumsum(rng.random((count, stride)) < 0.1, axis=0).astype(np.uint8)
        case "floats":
            return np.cumsum(rng.random((count, stride // 4)), axis=0).astype("<f4").view(np.uint8)
    return np.full((count, stride), 77, np.uint8)


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([(0, 4), (1, 4), (257, 4), (270, 8), (17, 12), (130, 64), (33, 252), (35, 256)]),
    st.sampled_from(["noise", "steps", "rare steps", "floats", "constant"]),
    st.sampled_from([0, 1]),
    st.data(),
)
@settings(max_examples=15)
def test_what_is_encoded_is_decoded(
    seed: int, shape: tuple[int, int], kind: str, version: int, data: st.DataObject
) -> None:
    count, stride = shape
    rows = table(seed, count, stride, kind)
    modes = data.draw(st.lists(st.sampled_from([0, 1, 2, 0x52, 0xF2]), min_size=stride // 4, max_size=stride // 4))
    stream = encoded_attributes(rows, version, modes if version else None)
    assert np.array_equal(decoded(stream, count, stride), rows)


@pytest.mark.parametrize(
    "name", ["version 0", "version 1, bytes and words", "version 1, turned words", "version 1, floats"]
)
def test_streams_of_meshoptimizer_are_decoded(name: str) -> None:
    stream, rows = fixed_attributes(name)
    assert np.array_equal(decoded(stream, *rows.shape), rows)


def test_the_example_of_the_specification() -> None:
    """Sixteen deltas, of four bits each but for two that are escaped."""
    group = bytes.fromhex("175ff0bc77a9210034b5")
    stream = b"\xa0" + (b"\x02" + group) + b"\0\0\0" + bytes(28) + bytes(4)
    deltas = [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]
    assert decoded(stream, 16, 4)[:, 0].tolist() == np.cumsum(deltas).astype(np.uint8).tolist()


def cases() -> list[tuple[bytes, str]]:
    rows = table(1, 40, 8, "steps")
    old, new = encoded_attributes(rows, 0, None), encoded_attributes(rows, 1, [0, 0])
    return [
        (b"", "does not say attributes"),
        (b"\xa2" + old[1:], "does not say attributes"),
        (b"\xe1" + old[1:], "does not say attributes"),
        (old[:20], "take at least 41 bytes, but there are 20"),
        (new[:1] + bytes(30) + new[1:], "follow the last element"),
        (old[:1] + b"\xff" * (len(old) - 1), "cut short"),
        (new[:1] + b"\xff" * (len(new) - 3) + b"\0\0", "cut short"),
        (new[:-1] + b"\x03", "channel is of an unknown mode"),
        (new[:-1] + b"\x10", "channel is of an unknown mode"),
    ]


@pytest.mark.parametrize(("stream", "message"), cases())
def test_damaged_streams_are_refused(stream: bytes, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        decoded(stream, 40, 8)


@pytest.mark.parametrize("version", [0, 1])
def test_a_stream_cut_short_anywhere_is_refused_or_other_rows(version: int) -> None:
    rows = table(2, 40, 8, "noise")
    stream = encoded_attributes(rows, version, [1, 0x32] if version else None)
    for length in range(len(stream)):
        with pytest.raises(MeshFileError):
            decoded(stream[:length], 40, 8)


@given(st.binary(max_size=120), st.integers(0, 60), st.sampled_from([4, 8]), st.sampled_from([b"\xa0", b"\xa1"]))
def test_any_bytes_give_rows_or_a_reason(data: bytes, count: int, stride: int, head: bytes) -> None:
    try:
        assert decoded(head + data, count, stride).shape == (count, stride)
    except MeshFileError as error:
        assert str(error)


def test_a_count_that_the_bytes_cannot_hold_takes_no_memory() -> None:
    import tracemalloc

    tracemalloc.start()
    with pytest.raises(MeshFileError, match="1000000000000 elements take at least"):
        decoded(b"\xa1" + bytes(100), 10**12, 4)
    assert tracemalloc.get_traced_memory()[1] < 100_000
    tracemalloc.stop()
