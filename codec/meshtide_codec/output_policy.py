"""What a command may write over: nothing that it did not make, unless the user says so. Checked before any work.

An output that is an input is refused, whatever its name: through links, another spelling, or a file system that takes
capital and small letters for the same. A file that is there already is refused without ``--overwrite``, unless it is
the command's own product of the same source. Pipes and devices are written, see `output_files`.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
import unicodedata
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_codec.errors import OptionError
from meshtide_codec.output_files import STANDARD_OUTPUT, is_standard_output, is_written_in_place, write_output
from meshtide_codec.printable import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

REMEDY = "name another file, or add --overwrite to replace it"


@dataclass(frozen=True, slots=True)
class OutputFile:
    """A file that may be written.

    Args:
        path: as the user named it, or ``-`` for standard output.
        replace: whether one that is there by then may be replaced.
    """

    path: Path
    replace: bool

    @property
    def real_path(self) -> Path:
        """Where it lies, symbolic links followed."""
        return Path(os.path.realpath(self.path))

    @property
    def replaces(self) -> bool:
        """Whether a regular file is there now, that will be replaced."""
        return self.replace and not self.is_standard_output and self.path.is_file()

    @property
    def is_standard_output(self) -> bool:
        """Whether it is standard output, so that messages have to go elsewhere."""
        return is_standard_output(self.path)

    def write(self, data: bytes) -> None:
        """Write it whole, or not at all.

        Raises:
            OSError: it cannot be written, or is there by now and may not be replaced.
        """
        write_output(self.path, data, replace=self.replace)


def output_file(
    path: Path,
    inputs: Iterable[Path | str] = (),
    *,
    overwrite: bool = False,
    own: Callable[[Path], bool] = lambda _: False,
    standard_output: bool = False,
    new_folder: bool = False,
) -> OutputFile:
    """The file at `path`, once it is sure that a command may write it.

    Args:
        path: the output, named by the user or by default.
        inputs: what the command reads; what is no file is passed over.
        overwrite: whether the user wants existing files replaced.
        own: whether an existing file is the command's own product of the same source.
        standard_output: whether ``-`` stands for standard output.
        new_folder: whether its folder may be missing, because the command makes it.

    Raises:
        OptionError: it is one of the inputs, exists and may not be replaced, is a folder, or has none to lie in.
        OSError: it cannot be looked at, or nothing can be written into its folder.
    """
    if str(path) == STANDARD_OUTPUT:
        if not standard_output:
            raise OptionError("this command does not write to standard output; name a file with -o")
        if sys.stdout.isatty():
            raise OptionError("standard output is a terminal; send it to a file or a pipe, or name a file with -o")
        return OutputFile(path, replace=True)
    for source in inputs:
        if is_same_file(path, source):
            raise OptionError(f"{shown(path)} is what is read ({shown(source)}); name another file with -o")
    if is_written_in_place(path):
        return _device(path, overwrite=overwrite)
    if not new_folder or path.parent.exists():
        _check_place(path)
    replace = overwrite
    if path.exists() and not overwrite:
        if not own(path):
            raise OptionError(f"{shown(path)} is there already; {REMEDY}")
        replace = True
    return OutputFile(path, replace)


def output_folder(folder: Path) -> None:
    """Make sure that a folder is there, or can be made.

    Raises:
        OptionError: a file has its name, or that of a folder above.
        OSError: it cannot be looked at, or nothing can be written into it.
    """
    there = folder
    while not there.exists() and there != there.parent:
        there = there.parent
    if not there.is_dir():
        raise OptionError(f"{shown(there)} is a file; name a folder")
    if there.exists():
        _check_writable(there, folder)


def check_different(outputs: Iterable[tuple[str, Path | str]]) -> None:
    """Make sure that no two sources lead to one name: not either where letters are folded, as on many disks.

    Args:
        outputs: for each source, in order, the name of what is written for it, and the source.

    Raises:
        OptionError: two do.
    """
    taken: dict[str, Path | str] = {}
    for name, source in outputs:
        first = taken.setdefault(unicodedata.normalize("NFC", name).casefold(), source)
        if first != source:
            raise OptionError(
                f"{shown(first)} and {shown(source)} would both become {shown(name)}; rename one of them, or write "
                "them to different folders"
            )


def check_apart(path: Path, other: Path | None) -> None:
    """Make sure that two outputs of one command are two files.

    Raises:
        OptionError: they are one.
    """
    if other is not None and is_same_file(path, other):
        raise OptionError(f"{shown(path)} would be written twice, as {shown(other)} too; name two files")


def is_same_file(path: Path | str, other: Path | str) -> bool:
    """Whether two names stand for one file, that need not be there yet; what cannot be looked at is another one."""
    try:
        return Path(path).samefile(other)
    except (OSError, ValueError):  # one of them is not there, or no name of a file
        pass
    try:
        return os.path.realpath(path) == os.path.realpath(other)
    except (OSError, ValueError):
        return False


def _device(path: Path, *, overwrite: bool) -> OutputFile:
    """What is no regular file; a disk holds something, so it is a file like others in this."""
    if path.exists() and stat.S_ISBLK(path.stat().st_mode) and not overwrite:
        raise OptionError(f"{shown(path)} is a block device; {REMEDY}")
    return OutputFile(path, replace=True)


def _check_place(path: Path) -> None:
    """Raise unless a regular file can be at `path`."""
    if path.is_dir():
        raise OptionError(f"{shown(path)} is a folder; name a file, such as {shown(path / 'name')}")
    folder = Path(os.path.realpath(path)).parent
    if not folder.exists():
        raise OptionError(f"{shown(path)} cannot be written: there is no folder {shown(folder)}; make it first")
    if not folder.is_dir():
        raise OptionError(f"{shown(path)} cannot be written: {shown(folder)} is no folder")
    _check_writable(folder, path)
    if path.exists() and not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, "the file is write-protected", str(path))


def _check_writable(folder: Path, path: Path) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, f"nothing can be written into the folder {shown(folder)}", str(path))
