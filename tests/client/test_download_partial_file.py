from __future__ import annotations

import errno
import threading
from typing import TYPE_CHECKING, BinaryIO

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_client.download import partial_file
from meshtide_client.download.partial_file import PartialFile
from meshtide_codec.errors import OptionError, ProtocolError, TransferError
from meshtide_codec.stream.container import preamble, read_available, write_container
from streams import MadeUpStream

if TYPE_CHECKING:
    from pathlib import Path

STREAM = MadeUpStream()
WHOLE = write_container(STREAM.header, STREAM.packet_bytes)
START = len(preamble(STREAM.header_bytes))


def filled(path: Path, count: int) -> None:
    """Make a partial file of so many packets."""
    file = PartialFile(path)
    file.begin(STREAM.header, STREAM.header_bytes)
    for index in range(count):
        file.append(index, STREAM.packet_bytes[index])
    file.close()


def test_at_any_time_it_is_a_container_that_is_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    file = PartialFile(path)
    file.begin(STREAM.header, STREAM.header_bytes)
    for index, data in enumerate(STREAM.packet_bytes):
        _, packets, problem = read_available(path.read_bytes())
        assert len(packets) == index
        assert problem is not None
        file.append(index, data)
        assert file.size == path.stat().st_size
    file.close()
    assert path.read_bytes() == WHOLE


def test_what_it_holds_is_told(tmp_path: Path) -> None:
    file = PartialFile(tmp_path / "a.tide")
    assert file.summary() == "no level is complete yet"
    assert file.size == 0
    file.begin(STREAM.header, STREAM.header_bytes)
    for index, data in enumerate(STREAM.packet_bytes):
        file.append(index, data)
    assert "level 0 is complete (1000 vertices, 2000 faces)" in file.summary()
    assert str(tmp_path / "a.tide") in file.summary()
    file.close()


@given(cut=st.integers(0, len(WHOLE)))
def test_a_file_cut_anywhere_is_gone_on_with(tmp_path_factory: pytest.TempPathFactory, cut: int) -> None:
    path = tmp_path_factory.mktemp("cut") / "a.tide"
    path.write_bytes(WHOLE[:cut])
    sentences: list[str] = []
    file = PartialFile(path, notify=sentences.append)
    if cut < START:
        assert file.header is None
        file.begin(STREAM.header, STREAM.header_bytes)
    assert len(file.stored_packets()) == file.count
    assert list(file.stored_packets()) == []
    for index in range(file.count, len(STREAM.packet_bytes)):
        file.append(index, STREAM.packet_bytes[index])
    file.close()
    assert path.read_bytes() == WHOLE
    assert sentences == []
    assert list(path.parent.iterdir()) == [path]


@given(place=st.integers(START, len(WHOLE) - 1), bit=st.integers(0, 7))
def test_a_damaged_packet_is_not_trusted(tmp_path_factory: pytest.TempPathFactory, place: int, bit: int) -> None:
    path = tmp_path_factory.mktemp("damaged") / "a.tide"
    damaged = bytearray(WHOLE)
    damaged[place] ^= 1 << bit
    path.write_bytes(damaged)
    sentences: list[str] = []
    file = PartialFile(path, notify=sentences.append)
    file.close()
    ends = [START + int(end) for end in STREAM.header.packet_offsets]
    assert ends[file.count] <= place < ends[file.count + 1]
    assert path.read_bytes() == WHOLE[: ends[file.count]]
    assert "is damaged" in sentences[0]


@pytest.mark.parametrize(
    "content", [b"a letter to a friend", b"\x89PNG\r\n\x1a\n" + bytes(100), WHOLE[:30] + bytes(1000), b"\0"]
)
def test_a_foreign_file_is_set_aside(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.tide"
    path.write_bytes(content)
    sentences: list[str] = []
    file = PartialFile(path, notify=sentences.append, disposable=True)
    assert file.header is None
    file.begin(STREAM.header, STREAM.header_bytes)
    file.close()
    assert (tmp_path / "a.tide.old1").read_bytes() == content
    assert path.read_bytes() == preamble(STREAM.header_bytes)
    assert "is not the beginning of a download" in sentences[0]
    assert "a.tide.old1" in sentences[0]


def test_what_was_set_aside_before_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    (tmp_path / "a.tide.old1").write_bytes(b"first")
    path.write_bytes(b"second")
    PartialFile(path).close()
    assert (tmp_path / "a.tide.old1").read_bytes() == b"first"
    assert (tmp_path / "a.tide.old2").read_bytes() == b"second"


def test_bytes_after_the_last_packet_are_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    path.write_bytes(WHOLE + b"more")
    sentences: list[str] = []
    file = PartialFile(path, notify=sentences.append)
    assert file.count == len(STREAM.packets)
    file.close()
    assert path.read_bytes() == WHOLE
    assert len(sentences) == 1


@pytest.mark.parametrize("disposable", [True, False])
def test_an_older_stream_gives_way_to_a_new_one(tmp_path: Path, disposable: bool) -> None:
    path = tmp_path / "a.tide"
    filled(path, 2)
    other = MadeUpStream(seed=1)
    file = PartialFile(path, disposable=disposable)
    file.begin(other.header, other.header_bytes)
    assert file.count == 0
    assert list(file.stored_packets()) == []
    file.append(0, other.packet_bytes[0])
    file.close()
    assert path.read_bytes() == preamble(other.header_bytes) + other.packet_bytes[0]
    kept = tmp_path / "a.tide.old1"
    assert kept.exists() is not disposable
    if not disposable:
        assert WHOLE.startswith(kept.read_bytes())


@pytest.mark.parametrize("content", [WHOLE, WHOLE + b"more", WHOLE[:-1], WHOLE[:-1] + bytes([WHOLE[-1] ^ 1])])
def test_a_file_that_is_to_be_kept_stays_to_the_byte(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.tide"
    path.write_bytes(content)
    other = MadeUpStream(seed=1)
    file = PartialFile(path, keep=True)
    with pytest.raises(OptionError, match="a.tide is there already, and holds another stream .*add --overwrite"):
        file.begin(other.header, other.header_bytes)
    file.close()
    assert path.read_bytes() == content
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_is_to_be_kept_and_no_download_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    for content in (b"a letter to a friend", WHOLE[:30] + bytes(1000)):
        path.write_bytes(content)
        with pytest.raises(OptionError, match="is there already, and no download"):
            PartialFile(path, keep=True)
        assert path.read_bytes() == content


def test_a_file_that_is_to_be_kept_is_gone_on_with(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    path.write_bytes(WHOLE[:-1] + bytes([WHOLE[-1] ^ 1]) + b"more")
    file = PartialFile(path, keep=True)
    assert file.count == len(STREAM.packets) - 1
    file.append(file.count, STREAM.packet_bytes[-1])
    file.close()
    assert path.read_bytes() == WHOLE
    file = PartialFile(tmp_path / "b.tide", keep=True)
    file.begin(STREAM.header, STREAM.header_bytes)
    other = MadeUpStream(seed=1)
    file.begin(
        other.header, other.header_bytes
    )  # the server has changed it meanwhile: what is there is this download's
    file.close()
    assert (tmp_path / "b.tide").read_bytes() == preamble(other.header_bytes)


def test_packets_out_of_order_are_refused(tmp_path: Path) -> None:
    file = PartialFile(tmp_path / "a.tide")
    file.begin(STREAM.header, STREAM.header_bytes)
    with pytest.raises(ProtocolError, match="packet 1 arrived where packet 0 was due"):
        file.append(1, STREAM.packet_bytes[1])
    file.close()


def test_a_file_in_which_nothing_was_written_is_removed(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    file = PartialFile(path)
    assert path.exists()
    file.close()
    file.close()
    assert not path.exists()


def test_discard_removes_it(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    filled(path, 1)
    PartialFile(path).discard()
    assert not path.exists()


def test_two_downloads_cannot_write_one_file(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    first = PartialFile(path)
    with pytest.raises(TransferError, match="being written by another process"):
        PartialFile(path)
    first.close()
    PartialFile(path).close()


def test_of_many_at_once_one_has_the_file(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    gate = threading.Barrier(8)
    won: list[PartialFile] = []
    lost: list[TransferError] = []

    def begin() -> None:
        gate.wait()
        try:
            won.append(PartialFile(path))
        except TransferError as error:
            lost.append(error)

    threads = [threading.Thread(target=begin) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (len(won), len(lost)) == (1, 7)
    won[0].close()
    assert not path.exists()


def test_a_file_that_another_process_has_finished_with_is_begun_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other one removes its file after this one has opened it, and before this one has locked it."""
    path = tmp_path / "a.tide"
    filled(path, 1)
    first = PartialFile(path)
    locked = partial_file._locked
    calls = 0

    def late(file: BinaryIO) -> bool:
        nonlocal calls
        calls += 1
        if calls == 1:
            first.discard()
        return locked(file)

    monkeypatch.setattr(partial_file, "_locked", late)
    second = PartialFile(path)
    assert (calls, second.count) == (2, 0)
    with pytest.raises(TransferError, match="being written by another process"):
        PartialFile(path)
    second.begin(STREAM.header, STREAM.header_bytes)
    second.close()
    assert path.exists()


def test_one_that_is_done_never_removes_the_file_of_the_next(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    filled(path, 1)
    first = PartialFile(path)
    first.discard()
    second = PartialFile(path)
    first.close()
    first.discard()
    assert path.exists()
    second.close()


def test_a_missing_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        PartialFile(tmp_path / "none" / "a.tide")


class FullDisk:
    """A file on a disk that has room for so many more bytes."""

    def __init__(self, file: object, room: int) -> None:
        self._file = file
        self._room = room

    def write(self, data: memoryview) -> int:
        if self._room == 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        written = self._file.write(data[: self._room])  # type: ignore[attr-defined]
        self._room -= written
        return int(written)

    def __getattr__(self, name: str) -> object:
        return getattr(self._file, name)


def test_a_full_disk_leaves_what_was_complete(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    file = PartialFile(path)
    file.begin(STREAM.header, STREAM.header_bytes)
    file.append(0, STREAM.packet_bytes[0])
    file._file = FullDisk(file._file, room=100)  # type: ignore[assignment]
    with pytest.raises(OSError, match="the disk is full; level 1 is complete") as caught:
        file.append(1, STREAM.packet_bytes[1])
    file.close()
    assert caught.value.errno == errno.ENOSPC
    assert caught.value.filename == str(path)
    assert path.read_bytes() == preamble(STREAM.header_bytes) + STREAM.packet_bytes[0]


def test_a_disk_that_is_full_from_the_start_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    file = PartialFile(path)
    file._file = FullDisk(file._file, room=10)  # type: ignore[assignment]
    with pytest.raises(OSError, match="nothing was complete yet"):
        file.begin(STREAM.header, STREAM.header_bytes)
    file.close()
    assert not path.exists()
