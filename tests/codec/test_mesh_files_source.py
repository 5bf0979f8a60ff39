"""The bytes of mesh files: paths, pipes, archives, and the names that a file may use."""

from __future__ import annotations

import gzip
import io
import os
import sys
import threading
import time
import tracemalloc
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files import load_mesh, source
from meshtide_codec.mesh_files.source import Source, expanded, format_suffix, largest_expansion, open_source

LIMITS = FileLimits()
OFF = b"OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


def test_a_file_is_read_as_it_stands(tmp_path: Path) -> None:
    path = tmp_path / "scan.OFF"
    path.write_bytes(OFF)
    found = open_source(path, LIMITS)
    assert (found.name, found.suffix, found.data, found.folder) == (str(path), ".off", OFF, tmp_path)
    assert open_source(path, LIMITS, kind="PLY").suffix == ".ply"
    assert open_source(path, LIMITS, kind=".ply").suffix == ".ply"
    assert open_source(path, LIMITS, alone=True).folder is None
    with pytest.raises(FileNotFoundError):
        open_source(tmp_path / "none.off", LIMITS)
    with pytest.raises(IsADirectoryError):
        open_source(tmp_path, LIMITS)


@pytest.mark.parametrize("length", [100, 101])
def test_a_file_may_be_as_long_as_the_limit(tmp_path: Path, length: int) -> None:
    (tmp_path / "a.off").write_bytes(b"x" * length)
    os.mkfifo(tmp_path / "pipe.off")
    for name in ("a.off", "pipe.off"):
        writer = threading.Thread(target=lambda: (tmp_path / "pipe.off").write_bytes(b"x" * length))
        if name == "pipe.off":
            writer.start()
        if length == 100:
            assert open_source(tmp_path / name, FileLimits(file_bytes=100)).data == b"x" * 100
        else:
            with pytest.raises(MeshFileError, match="claims 101 bytes; 100 are the most"):
                open_source(tmp_path / name, FileLimits(file_bytes=100))
        if name == "pipe.off":
            writer.join()


def test_a_pipe_without_end_is_read_no_further_than_the_limit() -> None:
    class Endless(io.RawIOBase):
        taken = 0

        def readable(self) -> bool:
            return True

        def seekable(self) -> bool:
            return False

        def read(self, size: int = -1) -> bytes:
            assert size > 0
            self.taken += size
            return bytes(size)

    endless = Endless()
    with pytest.raises(MeshFileError, match="5000000 are the most that is read"):
        source.read_bounded(endless, FileLimits(file_bytes=5_000_000))  # type: ignore[arg-type]
    assert endless.taken < 8_000_000


LARGE = (b"ply\0" + bytes(range(256)) * 5000)[: 1 << 20]


def test_large_binary_files_are_read_once_and_not_copied(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(LARGE)
    tracemalloc.start()
    found = open_source(path, LIMITS)
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert taken < len(LARGE) + 50_000
    assert isinstance(found.content, memoryview)
    assert found.view.readonly
    assert (found.view, found.data) == (LARGE, LARGE)
    path.write_bytes(b"ply " + LARGE.replace(b"\0", b" ")[4:])
    assert isinstance(open_source(path, LIMITS).content, bytes)
    path.write_bytes(gzip.compress(LARGE, 0))
    assert open_source(path, LIMITS).content == LARGE
    with pytest.raises(MeshFileError, match="claims 1048576 bytes; 1048575 are the most"):
        path.write_bytes(LARGE)
        open_source(path, FileLimits(file_bytes=len(LARGE) - 1))


@pytest.mark.parametrize("change", [-5000, -1, 1, 5000])
def test_a_file_that_changes_its_length_while_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: int
) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(LARGE)
    other = LARGE[:change] if change < 0 else LARGE + bytes(change)
    make = np.empty

    def empty(size: int, kind: Any) -> Any:
        path.write_bytes(other)
        return make(size, kind)

    monkeypatch.setattr(source.np, "empty", empty)
    assert open_source(path, FileLimits(file_bytes=len(LARGE) + 5000)).data == other


def test_a_fifo_is_a_file_like_others(tmp_path: Path) -> None:
    path = tmp_path / "scan.off.gz"
    os.mkfifo(path)

    def write_slowly() -> None:
        with path.open("wb") as file:
            for byte in gzip.compress(OFF):
                file.write(bytes([byte]))
                file.flush()
                time.sleep(0.0001)

    writer = threading.Thread(target=write_slowly)
    writer.start()
    assert load_mesh(path).faces.tolist() == [[0, 1, 2]]
    writer.join()


def test_standard_input_is_read_with_the_kind_that_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a").write_bytes(gzip.compress(OFF))
    with (tmp_path / "a").open("r") as file:
        monkeypatch.setattr(sys, "stdin", file)
        found = open_source("-", LIMITS, kind="off")
    assert (found.name, found.suffix, found.data, found.folder) == ("-", ".off", OFF, None)
    reading, writing = os.pipe()
    os.write(writing, OFF)
    os.close(writing)
    with os.fdopen(reading, "r") as file:
        monkeypatch.setattr(sys, "stdin", file)
        with pytest.raises(MeshFileError, match="- cannot be read as a mesh: .*--format names it"):
            load_mesh("-")


def test_suffixes() -> None:
    names = ["a.PLY", "a.b.Obj.GZ", "a", "a.gz", ".off", "folder.ply/a", "-"]
    assert [format_suffix(name) for name in names] == [".ply", ".obj", "", "", "", "", ""]


def test_notes_are_kept_once() -> None:
    found = Source("a", ".off", b"")
    for line in ("b", "a", "b"):
        found.note(line)
    assert found.notes == ["b", "a"]


def beside(folder: Path, reference: str) -> bytes | None:
    return Source("a.obj", ".obj", b"", folder).beside(reference, FileLimits(file_bytes=20))


def test_files_beside_are_read(tmp_path: Path) -> None:
    folder = tmp_path / "mesh"
    (folder / "below").mkdir(parents=True)
    (folder / "a b%20.mtl").write_bytes(b"1")
    (folder / "below" / "c.mtl").write_bytes(b"2")
    (folder / "link.mtl").symlink_to("below/c.mtl")
    (tmp_path / "linked").symlink_to(folder)
    for base in (folder, tmp_path / "linked", folder / "below" / ".."):
        assert beside(base, "a b%20.mtl") == b"1"
        assert beside(base, "below/c.mtl") == b"2"
        assert beside(base, "below\\c.mtl") == b"2"
        assert beside(base, "./below/../link.mtl") == b"2"
        assert beside(base, "missing.mtl") is None
        assert beside(base, "a%20b.mtl") is None


def test_files_elsewhere_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "mesh"
    folder.mkdir()
    (tmp_path / "secret").write_bytes(b"secret")
    (tmp_path / "mesh2").mkdir()
    (folder / "link").symlink_to(tmp_path / "secret")
    (folder / "up").symlink_to(tmp_path)
    (folder / "loop").symlink_to("loop")
    (folder / "long").write_bytes(bytes(21))
    os.mkfifo(folder / "pipe")
    references = {
        "../secret": "outside of its folder",
        "..\\secret": "outside of its folder",
        "x/../../secret": "outside of its folder",
        str(tmp_path / "secret"): "outside of its folder",
        "../mesh2": "outside of its folder",
        "link": "outside of its folder",
        "up/secret": "outside of its folder",
        "/etc/passwd": "outside of its folder",
        ".": "not a regular file",
        "": "not a regular file",
        "pipe": "not a regular file",
        "long": "claims 21 bytes; 20 are the most",
        "nul\0": "no file can be called",
        "loop": "cannot be read",
        "n" * 5000: "cannot be read: File name too long",
        "\ud800": "cannot be read: no file can be called so",
    }
    for reference, message in references.items():
        with pytest.raises(MeshFileError, match=message):
            beside(folder, reference)
    with pytest.raises(MeshFileError, match="names another one, 'a.mtl'; put everything into one file"):
        Source("a.obj", ".obj", b"").beside("a.mtl", LIMITS)


@given(st.lists(st.binary(max_size=3000), min_size=1, max_size=4), st.integers(0, 3))
@settings(max_examples=50)
def test_archives_of_several_members_are_unpacked(parts: list[bytes], padding: int) -> None:
    packed = b"".join(gzip.compress(part, level) + bytes(padding) for level, part in enumerate(parts))
    assert expanded(packed, LIMITS) == b"".join(parts)


def test_an_archive_that_is_cut_off_anywhere_is_refused() -> None:
    packed = gzip.compress(OFF * 20)
    for length in range(2, len(packed)):
        with pytest.raises(MeshFileError, match="the archive is cut short"):
            expanded(packed[:length], LIMITS)


def test_damaged_archives_are_refused() -> None:
    packed = bytearray(gzip.compress(os.urandom(1000)))
    packed[-6] ^= 1  # of the checksum
    with pytest.raises(MeshFileError, match=r"the archive is damaged\Z"):
        expanded(bytes(packed), LIMITS)
    with pytest.raises(MeshFileError, match=r"the archive is damaged\Z"):
        expanded(gzip.compress(OFF) + b"\x1f\x8bbehind it", LIMITS)
    with pytest.raises(MeshFileError, match="the archive is cut short"):
        expanded(gzip.compress(OFF) + b"\x1f", LIMITS)


def test_bytes_after_an_archive_are_told_and_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.off.gz"
    path.write_bytes(gzip.compress(OFF) + bytes(3) + b"behind it")
    source = open_source(path, LIMITS)
    assert source.data == OFF
    assert source.notes == ["9 bytes after the archive: left out"]


def test_an_archive_may_grow_to_a_bound(tmp_path: Path) -> None:
    assert largest_expansion(10, LIMITS) == 1 << 24
    assert largest_expansion(1 << 20, LIMITS) == 100 << 20
    assert largest_expansion(1 << 20, FileLimits(file_bytes=1000)) == 1000
    bomb = gzip.compress(bytes(40_000_000))
    tracemalloc.start()
    try:
        with pytest.raises(MeshFileError, match=f"expands to more than {1 << 24} bytes from {len(bomb)}"):
            expanded(bomb, LIMITS)
        assert tracemalloc.get_traced_memory()[1] < 24_000_000
    finally:
        tracemalloc.stop()
    with pytest.raises(MeshFileError, match="expands to more than 1000 bytes"):
        expanded(gzip.compress(bytes(1001)), FileLimits(file_bytes=1000))
    assert expanded(gzip.compress(bytes(1000)), FileLimits(file_bytes=1000)) == bytes(1000)
    (tmp_path / "a.off.gz").write_bytes(bomb)
    with pytest.raises(MeshFileError, match=r"a\.off\.gz cannot be read as a mesh: the archive expands"):
        load_mesh(tmp_path / "a.off.gz")


def test_an_archive_of_very_many_members_copies_little(monkeypatch: pytest.MonkeyPatch) -> None:
    copied = 0

    class Counting:
        def __init__(self, wbits: int) -> None:
            self.inner = original(wbits)

        def __getattr__(self, name: str) -> object:
            nonlocal copied
            value = getattr(self.inner, name)
            if isinstance(value, bytes):
                copied += len(value)
            return value

    original = zlib.decompressobj
    monkeypatch.setattr(source.zlib, "decompressobj", Counting)
    packed = gzip.compress(b"x") * 2000
    assert expanded(packed, LIMITS) == b"x" * 2000
    assert copied < 30 * len(packed)
    copied = 0
    packed = gzip.compress(bytes(15_000_000))
    assert expanded(packed, LIMITS) == bytes(15_000_000)
    assert copied < 30 * len(packed)


def test_what_was_packed_twice_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.off.gz").write_bytes(gzip.compress(gzip.compress(OFF)))
    with pytest.raises(MeshFileError, match="taken for .*off, but its content is a gzip archive"):
        load_mesh(tmp_path / "a.off.gz")
