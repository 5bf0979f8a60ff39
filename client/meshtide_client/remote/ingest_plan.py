"""Which files of an ingest are sent: each content once, whatever the files that hold it are called.

What a server or a catalogue has already is known by the SHA-256 of the file that it was made of. A content that is
there is left alone; one that two files share is sent once; two files of one name with different contents are two
meshes. So an ingest that was interrupted goes on where it stopped when it is repeated.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

from meshtide_client.remote.folder_search import found_below, oddity
from meshtide_codec.errors import OptionError
from meshtide_codec.mesh_files import is_mesh_path
from meshtide_codec.mesh_files.source import format_suffix
from meshtide_codec.printable import listed_name, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from meshtide_client.remote.folder_search import Skipped

FAILED = "failed"
SKIPPED = "skipped"
_PREFERENCE = (FAILED, "encoding", "ready")
"""Of several meshes of one content, which one stands for them."""


class Known(Protocol):
    """A mesh that is there already, as a listing shows it."""

    @property
    def id(self) -> str:
        """Its id."""

    @property
    def name(self) -> str:
        """Name of the file that it was made of."""

    @property
    def status(self) -> str:
        """Whether it is "ready", "encoding" or "failed"."""

    @property
    def source(self) -> str | None:
        """SHA-256 of that file, in hexadecimal; None if it was not published."""


@dataclass(frozen=True, slots=True)
class Ingested:
    """What became of one file.

    Args:
        file: itself.
        mesh: id of its mesh, or None if there is none.
        state: "done", "kept" for one whose content was there already, "failed", "left" for one that was not begun, or
            "skipped" for what lies in a folder and is not a file.
        error: why it failed, was left or skipped.
        notes: what of the file is not in the stream, or was read differently.
    """

    file: Path
    mesh: str | None
    state: str
    error: str | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Sending:
    """A file to be sent.

    Args:
        file: itself.
        digest: SHA-256 of its content, in hexadecimal.
        mesh: id of the mesh that it replaces, or None for a new one.
    """

    file: Path
    digest: str
    mesh: str | None


def mesh_files(paths: Sequence[Path]) -> tuple[list[Path], list[Ingested]]:
    """Mesh files and streams: those that are named, and those in folders that are named, at any depth, sorted.

    Returns:
        The files, and what in the folders was skipped, with the reason.

    Raises:
        OptionError: one of them is not there or no file, or there are no meshes at all.
    """
    found: list[Path] = []
    skipped: list[Skipped] = []
    for path in paths:
        if path.is_dir():
            inside, odd = found_below(path, _is_hosted)
            found += inside
            skipped += odd
        elif path.is_file():
            found.append(path)
        elif path.exists() or path.is_symlink():
            raise OptionError(f"{shown(path)} {oddity(path)}; name files and folders")
        else:
            raise OptionError(f"there is no file or folder {shown(path)}")
    if not found:
        reasons = "".join(f"; {shown(path)} {reason}" for path, reason, _ in skipped)
        raise OptionError(f"there are no meshes to ingest: no .ply, .obj, .off, .stl, .glb or .tide file{reasons}")
    rows = [Ingested(path, None, FAILED if failed else SKIPPED, f"it {reason}") for path, reason, failed in skipped]
    return list(dict.fromkeys(found)), rows


class IngestPlan:
    """Goes through the files once, and decides for each what is to be done.

    With `replace`, what is there is made again: a file whose content is there replaces that mesh, and one whose name is
    there, once there and once among the files, replaces the mesh of that name. A mesh that failed is always replaced.

    Args:
        files: all files, in order.
        known: the meshes that are there.
        replace: whether they are replaced.
        report: called for each file that need not, or cannot, be sent.
    """

    def __init__(
        self, files: Sequence[Path], known: Iterable[Known], *, replace: bool, report: Callable[[Ingested], None]
    ) -> None:
        self._files = files
        self._replace = replace
        self._report = report
        self._names = Counter(map(listed_name, files))
        self._published = [mesh for mesh in known if mesh.source is not None and mesh.status in _PREFERENCE]
        best_last = sorted(self._published, key=lambda mesh: _PREFERENCE.index(mesh.status))
        self._by_content = {mesh.source: mesh for mesh in best_last}
        self._known_names = Counter(mesh.name for mesh in self._published)
        self._by_name = {mesh.name: mesh for mesh in self._published}
        self._first: dict[str, Path] = {}
        self._twins: dict[Path, Path] = {}
        self._replaced: set[str] = set()

    def to_send(self) -> Iterator[Sending]:
        """The files to be sent; each is read, for its digest, when it is its turn."""
        for file in self._files:
            try:
                with file.open("rb") as opened:
                    digest = hashlib.file_digest(opened, "sha256").hexdigest()
            except OSError as error:
                self._report(Ingested(file, None, FAILED, f"{file} cannot be read: {error.strerror or error}"))
                continue
            first = self._first.setdefault(digest, file)
            if first is not file:
                self._twins[file] = first
                continue
            found = self._by_content.get(digest)
            if found is not None and found.status != FAILED and not self._replace:
                self._report(Ingested(file, found.id, "kept"))
            else:
                yield Sending(file, digest, self._to_replace(file, found))

    def report_twins(self, results: Mapping[Path, Ingested]) -> None:
        """Report the files whose content another one has, once it is known what became of that one."""
        for file, first in self._twins.items():
            result = results[first]
            self._report(replace(result, file=file, state=result.state if result.error else "kept", notes=()))

    def _to_replace(self, file: Path, same: Known | None) -> str | None:
        """The id of the mesh that `file` replaces; no mesh is replaced by two files."""
        found = same
        name = listed_name(file)
        if found is None and self._replace and self._names[name] == self._known_names[name] == 1:
            found = self._by_name[name]
        if found is None or found.id in self._replaced:
            return None
        self._replaced.add(found.id)
        return found.id


def _is_hosted(file: Path) -> bool:
    return file.suffix.lower() == ".tide" or (is_mesh_path(file) and format_suffix(file.name) != ".gltf")
