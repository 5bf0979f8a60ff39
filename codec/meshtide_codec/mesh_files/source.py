"""The bytes of a mesh file, and of those that it names: opened, unpacked, bounded.

A mesh file is a path, `-` for standard input, or bytes that are already there. What is packed by gzip is unpacked as
far as the limits allow. Files that a mesh file names (materials, buffers, images) are read only from its own folder or
below it, and only where there is one: a file that came through a pipe or from a stranger names nothing.
"""

from __future__ import annotations

import os
import re
import sys
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.file_suffix import GZIP_SUFFIX, split_name

if TYPE_CHECKING:
    from collections.abc import Iterator

    from meshtide_codec.limits import FileLimits

STANDARD_INPUT = "-"
GZIP_MAGIC = b"\x1f\x8b"
_PIECE = 1 << 20
_LARGE = 1 << 20
_HEAD = 1 << 12
_SMALL_INPUT = 1 << 9
_ZEROS = re.compile(rb"\0*")
_FREE_EXPANSION = 1 << 24
_LARGEST_EXPANSION = 100
"""An archive may grow to 16 MiB, or to a hundred times its size: text of meshes grows five to twenty times."""


@dataclass(frozen=True, slots=True)
class Source:
    """A mesh file that is to be read.

    Args:
        name: as the user gave it, for messages.
        suffix: what names the format, in lower case: ``.obj`` of ``scan.OBJ.gz``.
        content: its bytes, unpacked.
        folder: where files that it names may lie; None: it may name none.
        notes: lines that a person should see, added to by its reader.
    """

    name: str
    suffix: str
    content: bytes | memoryview
    folder: Path | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def data(self) -> bytes:
        """Its bytes, for readers of text; of a large binary file this is a copy."""
        return bytes(self.content)

    @property
    def view(self) -> memoryview:
        """Its bytes, never copied."""
        return memoryview(self.content)

    def note(self, line: str) -> None:
        """Keep a line for the person who waits; the same line is kept once."""
        if line not in self.notes:
            self.notes.append(line)

    def beside(self, reference: str, limits: FileLimits) -> bytes | None:
        """The bytes of a file that this one names, or None if there is none.

        Args:
            reference: its name, relative to the folder of this file, with slashes of either kind.
            limits: how large it may be.

        Raises:
            MeshFileError: it lies elsewhere, is not a regular file, cannot be read, or is too large.
        """
        shown = reference[:200]
        if self.folder is None:
            raise MeshFileError(f"the file names another one, {shown!r}; put everything into one file")
        if "\0" in reference:
            raise MeshFileError(f"the file names {shown!r}, which no file can be called")
        try:
            folder = self.folder.resolve()
            path = (folder / reference.replace("\\", "/")).resolve()
            if not path.is_relative_to(folder):
                raise MeshFileError(f"the file names {shown!r}, which lies outside of its folder")
            if not path.exists():
                return None
            if not path.is_file():
                raise MeshFileError(f"the file names {shown!r}, which is not a regular file")
            with path.open("rb") as file:
                return read_bounded(file, limits)
        except UnicodeEncodeError as error:
            raise MeshFileError(f"the file names {shown!r}, which cannot be read: no file can be called so") from error
        except (OSError, RuntimeError, ValueError) as error:  # a name that is too long, a circle of links, no right
            reason = getattr(error, "strerror", None) or "its name leads to no file"
            raise MeshFileError(f"the file names {shown!r}, which cannot be read: {reason}") from error


def format_suffix(name: str) -> str:
    """The suffix that names the format of a file, in lower case.

    >>> format_suffix("scan.OBJ.gz"), format_suffix("scan.ply"), format_suffix("-")
    ('.obj', '.ply', '')
    """
    return split_name(name).suffix.lower().removesuffix(GZIP_SUFFIX)


def open_source(path: Path | str, limits: FileLimits, *, kind: str | None = None, alone: bool = False) -> Source:
    """Read a mesh file from a path, a pipe, or standard input.

    Args:
        path: of the file, or `-` for standard input.
        limits: how large it may be, unpacked or not.
        kind: of its content, such as ply, in place of what its name says.
        alone: whether it may name no other files.

    Raises:
        MeshFileError: it is too large, or a damaged archive.
        OSError: it cannot be read.
    """
    name = str(path)
    if name == STANDARD_INPUT:
        data: bytes | memoryview = read_bounded(sys.stdin.buffer, limits)
        folder = None
    else:
        with Path(path).open("rb") as file:
            data = _binary(file, limits) or read_bounded(file, limits)
            folder = None if alone else Path(path).parent
    notes: list[str] = []
    if data[:2] == GZIP_MAGIC:
        data = expanded(bytes(data), limits, notes)
    suffix = format_suffix(name) if kind is None else f".{kind.lstrip('.').lower()}"
    return Source(name, suffix, data, folder, notes)


def _binary(file: BinaryIO, limits: FileLimits) -> memoryview | None:
    """All bytes of a large file that is not text, in memory of numpy's; None, and the file at its start, for others.

    numpy asks for large pages: filling them takes half the time of filling as many bytes of Python's.
    """
    size = os.fstat(file.fileno()).st_size if file.seekable() else 0
    if size < _LARGE:
        return None
    limits.check("file_bytes", size)
    head = file.read(_HEAD)
    file.seek(0)
    if b"\0" not in head or head.startswith(GZIP_MAGIC):
        return None
    view = np.empty(size, np.uint8).data
    read = 0
    while read < size and (more := file.readinto(view[read:])):  # type: ignore[attr-defined]
        read += more
    if read < size or file.read(1):  # it is being written to
        file.seek(0)
        return None
    return view.toreadonly()


def read_bounded(file: BinaryIO, limits: FileLimits) -> bytes:
    """All bytes of a file, unless they are more than the limits allow.

    Raises:
        MeshFileError: they are.
        OSError: it cannot be read.
    """
    size = os.fstat(file.fileno()).st_size if file.seekable() else 0
    limits.check("file_bytes", size)
    pieces = [file.read()] if size else list(_pieces(file, limits.file_bytes))
    limits.check("file_bytes", sum(map(len, pieces)))
    return pieces[0] if len(pieces) == 1 else b"".join(pieces)


def _pieces(file: BinaryIO, most: int) -> Iterator[bytes]:
    """What a pipe holds, until it ends or is longer than `most`."""
    size = 0
    while size <= most and (piece := file.read(_PIECE)):
        size += len(piece)
        yield piece


def expanded(data: bytes, limits: FileLimits, notes: list[str] | None = None) -> bytes:
    """What a gzip archive holds; bytes behind it are left out unless they are another archive, as gunzip does.

    Args:
        data: the archive.
        limits: how large its content may be.
        notes: a line for the person who waits is added to these if bytes were left out.

    Raises:
        MeshFileError: it is damaged, cut short, or grows more than a file of a mesh would.

    >>> import gzip
    >>> from meshtide_codec.limits import FileLimits
    >>> expanded(gzip.compress(b"v 0 0 0"), FileLimits())
    b'v 0 0 0'
    """
    most = largest_expansion(len(data), limits)
    pieces: list[bytes] = []
    size = position = 0
    try:
        while position < len(data):
            member = zlib.decompressobj(wbits=31)
            waiting, fed = b"", _SMALL_INPUT  # a member may be tiny, and what it does not use is copied
            while not member.eof:
                if not waiting:
                    waiting, fed = data[position : position + fed], min(2 * fed, _PIECE)
                    position += len(waiting)
                    stuck = not waiting
                piece = member.decompress(waiting, _PIECE)
                waiting = member.unconsumed_tail
                size += len(piece)
                if size > most:
                    raise MeshFileError(f"the archive expands to more than {most} bytes from {len(data)}")
                if stuck and not piece and not member.eof:
                    raise MeshFileError("the archive is cut short")
                if piece:
                    pieces.append(piece)
            position = _after_zeros(data, position - len(member.unused_data))
            if not GZIP_MAGIC.startswith(data[position : position + len(GZIP_MAGIC)]):
                if notes is not None:
                    notes.append(f"{len(data) - position} bytes after the archive: left out")
                break
    except zlib.error as error:
        raise MeshFileError("the archive is damaged") from error
    return b"".join(pieces)


def _after_zeros(data: bytes, position: int) -> int:
    """Where the next member begins, behind the padding of tapes."""
    zeros = _ZEROS.match(data, position)
    return position if zeros is None else zeros.end()


def largest_expansion(size: int, limits: FileLimits) -> int:
    """How many bytes an archive of `size` bytes may hold."""
    return min(limits.file_bytes, max(_FREE_EXPANSION, _LARGEST_EXPANSION * size))
