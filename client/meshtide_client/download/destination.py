"""Where a fetch leaves its files, and whether it may: looked at before anything is downloaded."""

from __future__ import annotations

import glob
import hashlib
import os
from dataclasses import dataclass
from tempfile import TemporaryFile
from typing import TYPE_CHECKING

from meshtide_client.connection.tide_address import TideAddress
from meshtide_client.download.holding import Holding
from meshtide_client.download.partial_file import PartialFile
from meshtide_codec.errors import OptionError
from meshtide_codec.mesh_files.write import format_of
from meshtide_codec.output_files import is_written_in_place
from meshtide_codec.output_policy import check_apart, output_file, output_folder
from meshtide_codec.packets import MAGIC
from meshtide_codec.printable import shown

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from meshtide_client.connection.tide_address import Address
    from meshtide_codec.limits import Limits

_PARTIAL_SUFFIX = ".partial.tide"
_LONGEST_NAME = 255
"""Bytes of a file name that common file systems take."""


@dataclass(frozen=True, slots=True)
class Destination:
    """Where a fetch leaves its files.

    Args:
        output: file of the finest mesh, or None.
        stream_file: `.tide` file of the packets, kept afterwards, or None.
        keep_levels: folder for the mesh of each level, or None.
        overwrite: whether files of meshes that are there already are replaced.
        kind: format of the output, in place of what its name says; what is not a regular file is PLY without it.
        resumable: whether a next fetch may go on where this one ends: not with a file of this machine, which it would
            find as it is.

    Raises:
        OptionError: the output's format is unknown.
    """

    output: Path | None = None
    stream_file: Path | None = None
    keep_levels: Path | None = None
    overwrite: bool = True
    kind: str | None = None
    resumable: bool = True

    def __post_init__(self) -> None:
        if self.output is not None:
            format_of(self.output, self.kind)

    @property
    def partial_path(self) -> Path | None:
        """Where packets are kept while they arrive."""
        if self.stream_file is not None or self.output is None:
            return self.stream_file
        if not self.resumable or is_written_in_place(self.output):
            return None
        return self.output.with_name(_partial_name(self.output.name))

    def prepare(self, address: Address) -> None:
        """Make sure that files can be written, and may be, before anything is downloaded.

        Args:
            address: what is fetched; a file of this machine is not written over.

        Raises:
            OptionError: two of the files are one, or one is there that is not to be replaced.
            OSError: a folder may not be written.
        """
        read = [address.location] if isinstance(address, TideAddress) and address.kind == "local" else []
        if self.output is not None:
            check_apart(self.output, self.stream_file)
        self.check_output(*read)
        if self.stream_file is not None and is_written_in_place(self.stream_file):
            raise OptionError(
                f"{shown(self.stream_file)} is not a regular file, which a stream is kept in; name another"
            )
        if self.partial_path is not None:
            output_file(self.partial_path, read, overwrite=self.overwrite, own=_is_download)
        if self.keep_levels is not None:
            check_levels(self.keep_levels, address.file_stem, overwrite=self.overwrite)
        files = [file for file in (self.output, self.stream_file) if file is not None and not is_written_in_place(file)]
        for file in files:
            _check_writable(file.parent)

    def check_output(self, *read: Path | str) -> None:
        """Make sure that the output may be written.

        Raises:
            OptionError: it is what is read, or is there and not to be replaced.
        """
        if self.output is not None:
            output_file(self.output, read, overwrite=self.overwrite)

    def open(self, limits: Limits | None, notify: Callable[[str], None] | None) -> Holding:
        """The holding that packets go into.

        Raises:
            OptionError: the stream file holds something else, and is not to be replaced.
            TransferError: another process is writing it.
            OSError: it cannot be read or written.
        """
        path = self.partial_path
        if path is None:
            return Holding()
        own = self.stream_file is None
        return PartialFile(
            path,
            limits=limits,
            notify=notify,
            disposable=own,
            keep=not own and not self.overwrite,
            resumable=self.resumable,
        )


def check_levels(folder: Path, stem: str, *, overwrite: bool) -> None:
    """Make sure that levels of a mesh may be written into a folder.

    Raises:
        OptionError: it is a file, or holds levels of that name that are not to be replaced.
        OSError: it may not be written.
    """
    output_folder(folder)
    found = [] if overwrite else sorted(folder.glob(f"{glob.escape(stem)}-level-*.ply"))
    if found:
        raise OptionError(f"{shown(found[0])} is there already; name another folder, or add --overwrite")


def _partial_name(name: str) -> str:
    """The name of the file beside an output; shortened where a file system would not take it."""
    whole = f"{name}{_PARTIAL_SUFFIX}"
    if len(os.fsencode(whole)) <= _LONGEST_NAME:
        return whole
    return f"{hashlib.sha256(os.fsencode(name)).hexdigest()[:32]}{_PARTIAL_SUFFIX}"


def _is_download(path: Path) -> bool:
    """Whether a file begins as a stream does, so that it can be resumed; an empty one has not got that far."""
    with path.open("rb") as file:
        start = file.read(len(MAGIC))
    return start == MAGIC[: len(start)]


def _check_writable(folder: Path) -> None:
    try:
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}; the download was not started", str(folder)) from error
