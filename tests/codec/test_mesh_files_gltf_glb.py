"""The frame of GLB files: chunks in and out, and frames that lie."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gltf_files import GltfFile, glb, pyramid_file, read
from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.mesh_files.gltf.glb import pack, unpack


@given(st.binary(max_size=40), st.binary(max_size=40))
def test_what_is_packed_is_unpacked_with_padding(text: bytes, binary: bytes) -> None:
    data = pack(text, binary)
    frame = unpack(data)
    assert len(data) % 4 == 0
    assert frame.text.startswith(text)
    assert set(frame.text[len(text) :]) <= {0x20}
    assert bytes(frame.binary or b"").startswith(binary)
    assert frame.rest == 0


def test_unknown_chunks_are_skipped() -> None:
    data = pack(b"{}", b"1234") + struct.pack("<I4s", 4, b"XTRA") + b"more"
    data = data[:8] + struct.pack("<I", len(data)) + data[12:]
    frame = unpack(data)
    assert (frame.text, bytes(frame.binary or b""), frame.rest) == (b"{}  ", b"1234", 0)


def test_bytes_after_the_end_are_told() -> None:
    scene = read(pyramid_file().glb() + b"junk!")
    assert len(scene.mesh().faces) == 6
    assert scene.notes == ("5 bytes follow the end of the file: not read",)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "cut short: it has 0 bytes"),
        (b"glTF\2\0\0\0", "cut short: it has 8 bytes"),
        (b"glTG" + bytes(20), "does not begin with glTF"),
        (glb({}, version=1), "of version 1; version 2 is read"),
        (glb({}, length=2**32 - 1), "claims 4294967295 bytes, but has"),
        (glb({}, length=15), "cut short: 3 bytes stand where a chunk would begin"),
        (
            glb({})[:-12] + struct.pack("<I4s", 2**32 - 1, b"JSON") + bytes(4),
            "at byte 12 claims 4294967295 bytes, but 4 follow it",
        ),
        (struct.pack("<4sIII4s", b"glTF", 2, 20, 0, b"BIN\0"), "first chunk of the GLB file is not its JSON"),
        (struct.pack("<4sII", b"glTF", 2, 12), "first chunk of the GLB file is not its JSON"),
    ],
)
def test_a_frame_that_lies_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        unpack(data)


def test_a_file_cut_short_at_any_byte_is_an_error() -> None:
    data = pyramid_file().glb()
    for length in range(len(data)):
        with pytest.raises(MeshFileError):
            read(data[:length])


@given(st.data())
def test_changed_bytes_are_read_or_refused_with_a_reason(data: st.DataObject) -> None:
    file = pyramid_file()
    accessor = file.accessor([[0, 0, 1]] * 5, "<f4")
    file.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = accessor
    changed = bytearray(file.glb())
    for _ in range(data.draw(st.integers(1, 4))):
        changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))
    try:
        read(bytes(changed)).mesh()
    except MeshError as error:
        assert str(error)


def test_a_file_of_four_gigabytes_is_not_written() -> None:
    class Long(bytes):
        def __len__(self) -> int:
            return 1 << 32

        def __add__(self, other: bytes) -> bytes:
            return self

    with pytest.raises(MeshFileError, match="at most 4 GiB"):
        pack(b"{}", Long(b"x"))


def test_a_buffer_of_no_chunk_is_told() -> None:
    file = GltfFile()
    file.mesh({"attributes": {"POSITION": file.accessor([[0, 0, 0]] * 3, "<f4")}})
    data = glb(file.shown({"mesh": 0}).root | {"buffers": [{"byteLength": 36}]})
    with pytest.raises(MeshFileError, match=r"buffers\[0\] has no bytes: it names no file"):
        read(data)
