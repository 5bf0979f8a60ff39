"""A download on disk that can be resumed: a `.tide` file that ends early.

Preamble, header and whole packets are appended as they arrive, so the file is at any time a container that
`read_available` reads, cut off at most inside its last packet. What is found on opening is trusted only as far as
its checksums hold, and only after the server has confirmed that its stream still has the same header.
"""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from typing import TYPE_CHECKING, BinaryIO

from meshtide_client.download.holding import Holding
from meshtide_codec.errors import OptionError, StreamError, TransferError, TruncatedError
from meshtide_codec.output_policy import REMEDY
from meshtide_codec.packets import MAGIC
from meshtide_codec.printable import shown
from meshtide_codec.stream.container import ContainerReader, preamble

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from meshtide_codec.limits import Limits
    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import StreamHeader

_PIECE_BYTES = 1 << 20
_MOST_ATTEMPTS = 100
"""How often a file may vanish between opening and locking: others finish with it at that very moment."""


class PartialFile(Holding):
    """The file of a download; opens it, or makes it.

    Args:
        path: the file.
        limits: what its header may claim.
        notify: called with one sentence that says what was wrong with the file and what was done about it.
        disposable: whether the file is this program's own, so that it may be overwritten when the server's stream
            has changed; a file that a person named is renamed instead.
        keep: whether a file that holds another stream, or none, is left as it is, which is an error.
        resumable: whether the same request has a chance of getting further another time.

    Raises:
        OptionError: the file is to be kept, and no download.
        TransferError: another process is writing the file.
        OSError: it cannot be read or written.
    """

    def __init__(
        self,
        path: Path,
        *,
        limits: Limits | None = None,
        notify: Callable[[str], None] | None = None,
        disposable: bool = False,
        keep: bool = False,
        resumable: bool = True,
    ) -> None:
        super().__init__()
        self.path = path
        self._notify = notify or (lambda _: None)
        self._disposable = disposable
        self._resumable = resumable
        self._keep = keep
        """Whether what the file held when it was opened has to stay; until something of this download is in it."""
        self._stored: Sequence[Packet] = ()
        self._file = self._open()
        try:
            self._read(limits)
        except BaseException:
            self._file.close()
            raise

    def begin(self, header: StreamHeader, header_bytes: bytes) -> None:
        """Start over with a new stream; an older one is overwritten, or its file renamed.

        Raises:
            OptionError: the file is to be kept, and holds another stream.
            OSError: it cannot be written.
        """
        if self.header is not None and self._keep:
            raise OptionError(
                f"{shown(self.path)} is there already, and holds another stream than the server has; {REMEDY}"
            )
        if self.header is not None and not self._disposable:
            self._set_aside("holds an older stream")
        self._keep = False
        self._cut(0)
        super().begin(header, header_bytes)
        self._stored = ()
        try:
            self._write(preamble(header_bytes))
        except OSError:
            self.header, self.header_bytes = None, b""
            raise

    def stored_packets(self) -> Sequence[Packet]:
        """The packets that the file held when it was opened; returned only once, so that they do not stay in memory."""
        packets, self._stored = self._stored, ()
        return packets

    def close(self) -> None:
        """Close the file; one in which nothing was written is removed."""
        if self._file.closed:
            return
        if self.header is None:
            with suppress(OSError):
                self._remove()
        self._file.close()

    def discard(self) -> None:
        """Remove and close the file."""
        if not self._file.closed:
            self._remove()
            self._file.close()

    def _remove(self) -> None:
        """Remove the file while the lock on it holds, so that it is never one that another process has begun."""
        try:
            self.path.unlink(missing_ok=True)
        except PermissionError:  # Windows removes no open file
            self._file.close()
            self.path.unlink(missing_ok=True)

    def summary(self, *, repeat: bool = True) -> str:
        """One clause that says what is held and where."""
        if self.header is None:
            return super().summary(repeat=repeat)
        kept = f"{super().summary()}; what has arrived is kept in {self.path}"
        return f"{kept}, and the same request goes on from there" if self._resumable and repeat else kept

    def _open(self) -> BinaryIO:
        for _ in range(_MOST_ATTEMPTS):
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
            file: BinaryIO = os.fdopen(descriptor, "r+b", buffering=0)
            if not _locked(file):
                file.close()
                break
            if _is_at(file, self.path):
                return file
            file.close()  # another process has finished with it, and removed it, since it was opened
        raise TransferError(f"{self.path} is being written by another process; wait for it, or name another file")

    def _read(self, limits: Limits | None) -> None:
        """Take over what the file holds as far as it is sound."""
        reader = ContainerReader(limits)
        problem: StreamError | None = None
        try:
            while piece := self._file.read(_PIECE_BYTES):
                reader.feed(piece)
            reader.finish()
        except StreamError as error:
            problem = error
        if reader.header is None:
            self._refuse(problem)
            return
        self.header, self.header_bytes = reader.header, reader.header_bytes
        self.count = len(reader.packets)
        self._stored = reader.packets
        if problem is not None and not isinstance(problem, TruncatedError):
            self._notify(f"{self.path} is damaged ({problem}); its first {self.count} packets are sound and are used")
        if not self._keep:
            self._cut(self.size)

    def _refuse(self, problem: StreamError | None) -> None:
        """The file has no sound header: start anew, and keep what may be somebody else's."""
        self._file.seek(0)
        start = self._file.read(len(MAGIC))
        if isinstance(problem, TruncatedError) and start == MAGIC[: len(start)]:
            self._cut(0)
        elif self._keep:
            raise OptionError(f"{shown(self.path)} is there already, and no download ({problem}); {REMEDY}")
        else:
            self._set_aside(f"is not the beginning of a download ({problem})")

    def _set_aside(self, reason: str) -> None:
        """Rename the file and make a new one."""
        number = 1
        while (aside := self.path.with_name(f"{self.path.name}.old{number}")).exists():
            number += 1
        self._file.close()
        self.path.rename(aside)
        self._notify(f"{self.path} {reason}; it is now {aside.name}, and the download starts from the beginning")
        self._file = self._open()

    def _store(self, data: bytes) -> None:
        if self._keep:  # the server has this very stream: what is damaged or behind its packets may go
            self._cut(self.size)
            self._keep = False
        self._write(data)

    def _write(self, data: bytes) -> None:
        """Append `data` whole, or not at all."""
        end = self._file.tell()
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            with suppress(OSError):
                self._cut(end)
            reason = error.strerror or "it cannot be written"
            if error.errno == errno.ENOSPC:
                reason = "the disk is full"
            kept = (
                "nothing was complete yet" if self.state is None else f"{Holding.summary(self)} and stays in this file"
            )
            raise OSError(error.errno, f"{reason}; {kept}", str(self.path)) from error

    def _cut(self, size: int) -> None:
        self._file.truncate(size)
        self._file.seek(size)


def _is_at(file: BinaryIO, path: Path) -> bool:
    """Whether an open file is still the one of that name."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _locked(file: BinaryIO) -> bool:
    """Whether this process is now the only one that writes `file`; the lock ends with the open file."""
    try:
        import fcntl  # noqa: PLC0415 - does not exist on Windows, where an open file cannot be renamed by others anyway

        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except (ImportError, OSError):  # no locks here, as on some network drives: one fetch at a time is up to the user
        return True
    return True
