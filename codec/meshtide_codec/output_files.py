"""Files that commands write: whole, or not at all; and what is no regular file is written in place.

A regular file is written beside its place and moved there, so that nobody ever sees half of it. Symbolic links are
followed and stay. Pipes, devices and descriptors such as ``/dev/stdout`` take the bytes as they are. The unfinished
file is gone after any error, Ctrl-C, SIGTERM and SIGHUP, and every error names the file that the user named.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import stat
import sys
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_codec.termination import terminable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

STANDARD_OUTPUT = "-"
_DESCRIPTORS = re.compile(r"/dev/fd|/proc/(\d+)/(?:task/\d+/)?fd")
_MOST_LINKS = 40
"""Symbolic links that are followed on the way to a descriptor, as many as Linux follows."""


def write_output(path: Path | str, data: bytes, *, replace: bool = True) -> None:
    """Write a file as `write_atomically` does, or to standard output where `path` is ``-``.

    Raises:
        OSError: it cannot be written.
    """
    if str(path) == STANDARD_OUTPUT:
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
    else:
        write_atomically(Path(path), data, replace=replace)


def write_atomically(path: Path, data: bytes, *, replace: bool = True) -> None:
    """Write a file beside its place and move it there; what is no regular file is written in place.

    A file that is replaced keeps its permissions, and its owner where the system allows it.

    Args:
        path: the file; what a symbolic link names is written, and the link stays.
        data: its bytes.
        replace: whether a file that is there by then is replaced.

    Raises:
        FileExistsError: it is there and may not be replaced.
        OSError: it cannot be written; nothing is left behind.
    """
    with _naming(path):
        descriptor = _opened_in_place(path)
        if descriptor is None:
            real = Path(os.path.realpath(path))
            with _finished(real, data, replace=replace) as finished:
                _place(finished, real, replace=replace)
        else:
            with os.fdopen(descriptor, "wb") as file:
                file.write(data)


def write_together(files: Iterable[tuple[Path, bytes]], *, replace: bool = True) -> None:
    """Write several files, each as `write_atomically` does; none gets its name before all of them are complete.

    Raises:
        FileExistsError: one is there and may not be replaced.
        OSError: one cannot be written; nothing is left behind.
    """
    with ExitStack() as stack:
        complete = []
        in_place = []
        for path, data in files:
            with _naming(path):
                if is_written_in_place(path):
                    in_place.append((path, data))
                else:
                    real = Path(os.path.realpath(path))
                    complete.append((path, real, stack.enter_context(_finished(real, data, replace=replace))))
        for path, real, finished in complete:
            with _naming(path):
                _place(finished, real, replace=replace)
        for path, data in in_place:
            write_atomically(path, data)


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Make a folder for the block; if the block fails, those that were made and are empty are removed again.

    Raises:
        OSError: it cannot be made.
    """
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        for each in missing:
            with suppress(OSError):
                each.rmdir()
        raise


def move_into_place(finished: Path, path: Path, *, replace: bool = True) -> None:
    """Give a file that was written in the same folder its name.

    Raises:
        FileExistsError: there is one of that name, and it may not be replaced.
        OSError: it cannot be moved.
    """
    with _naming(path):
        _place(finished, Path(os.path.realpath(path)), replace=replace)


def is_standard_output(path: Path | str) -> bool:
    """Whether what is written to `path` comes out of this process's standard output: ``-``, ``/dev/stdout``."""
    return str(path) == STANDARD_OUTPUT or _descriptor(Path(path)) == 1


def is_written_in_place(path: Path) -> bool:
    """Whether `path` is a pipe, a device or a descriptor: something that bytes go into and that is not replaced.

    Raises:
        OSError: it cannot be looked at.
    """
    if _descriptor(path) is not None:
        return True
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Every error of the block names the file as the user did."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def _opened_in_place(path: Path) -> int | None:
    """A descriptor that what is no regular file is written through, or None."""
    own = _descriptor(path)
    if own is not None and own >= 0:
        return os.dup(own)
    if not is_written_in_place(path):
        return None
    return os.open(path, os.O_WRONLY)


def _descriptor(path: Path) -> int | None:
    """The number of this process's descriptor that `path` stands for; -1 for another process's; None for neither."""
    current = os.fspath(path)
    for _ in range(_MOST_LINKS):
        folder, name = os.path.realpath(os.path.dirname(current)), os.path.basename(current)  # noqa: PTH119, PTH120 - keeps links
        found = _DESCRIPTORS.fullmatch(folder)
        if found is not None and name.isdecimal():
            return int(name) if found[1] in {None, str(os.getpid())} else -1
        current = os.path.join(folder, name)  # noqa: PTH118 - the same
        try:
            current = os.path.join(folder, os.readlink(current))  # noqa: PTH115, PTH118 - the same
        except OSError:
            return None
    return None


@contextmanager
def _finished(real: Path, data: bytes, *, replace: bool) -> Iterator[Path]:
    """A complete file beside its place, for the block to move there; what the block leaves is removed."""
    existing = real.stat() if real.exists() else None
    if existing is not None:
        if stat.S_ISDIR(existing.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not replace:
            raise _there_by_now()
        if not os.access(real, os.W_OK):
            raise PermissionError(errno.EACCES, "the file is write-protected")
    unfinished = real.parent / f".meshtide-{secrets.token_hex(8)}.part"
    with terminable():
        try:
            _write_new(unfinished, data, existing)
            yield unfinished
        finally:
            with suppress(OSError):
                unfinished.unlink()


def _write_new(path: Path, data: bytes, existing: os.stat_result | None) -> None:
    """Write a new file, with owner and permissions of the one that it is to replace, or as the umask wants them."""
    with path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    if existing is not None:
        if hasattr(os, "chown") and (existing.st_uid, existing.st_gid) != _owner(path):
            with suppress(OSError):
                os.chown(path, existing.st_uid, existing.st_gid)
        path.chmod(stat.S_IMODE(existing.st_mode) & 0o777)


def _owner(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_uid, status.st_gid


def _place(unfinished: Path, real: Path, *, replace: bool) -> None:
    if replace:
        unfinished.replace(real)
    else:
        _place_new(unfinished, real)


def _place_new(unfinished: Path, real: Path) -> None:
    """Move a file to a place where none may be: of several processes that do so at once, one succeeds."""
    try:
        os.link(unfinished, real)
    except FileExistsError:
        raise _there_by_now() from None
    except OSError:  # a file system without hard links: the place is claimed by an empty file
        try:
            real.open("xb").close()
        except FileExistsError:
            raise _there_by_now() from None
        unfinished.replace(real)
    else:
        unfinished.unlink()


def _there_by_now() -> FileExistsError:
    return FileExistsError(errno.EEXIST, "another program has written this file in the meantime; it was left alone")
