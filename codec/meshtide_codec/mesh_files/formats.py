"""Which reader and which writer stand for which kind of file, and what a file's first bytes say of its kind."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Protocol, cast

from meshtide_codec.packets import MAGIC

if TYPE_CHECKING:
    from collections.abc import Mapping

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.source import Source
    from meshtide_codec.scene import Scene


@dataclass(frozen=True, slots=True)
class Written:
    """A scene as files.

    Args:
        data: of the file itself.
        companions: what it names, by names relative to its folder, such as materials and images.
        notes: what the format cannot hold, a line each.
    """

    data: bytes
    companions: Mapping[str, bytes] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


class Reader(Protocol):
    """Makes a scene of bytes: `read_obj` and its like, one for each format.

    It holds what the file declares against its bytes and the limits before it takes memory, raises MeshFileError and
    nothing else, and reports what a person should know through `source.note`.
    """

    def __call__(self, source: Source, limits: FileLimits) -> Scene:
        """The scene that the file holds."""


class Writer(Protocol):
    """Makes files of a scene: `write_obj` and its like."""

    def __call__(self, scene: Scene, name: str) -> Written:
        """The files; `name` is that of the file itself, without its folder."""


SUFFIXES: dict[str, str] = {
    ".obj": "obj",
    ".ply": "ply",
    ".off": "off",
    ".stl": "stl",
    ".glb": "gltf",
    ".gltf": "gltf",
}
"""The package of each format by the suffix of its files; `read_NAME` and `write_NAME` are in it."""


def reader_of(suffix: str) -> Reader | None:
    """The reader of files with that suffix, or None for a format without one of our own."""
    return cast("Reader | None", _member(suffix, "read"))


def writer_of(suffix: str) -> Writer | None:
    """The writer of files with that suffix, or None for a format without one of our own."""
    return cast("Writer | None", _member(suffix, "write"))


def _member(suffix: str, verb: str) -> object:
    name = SUFFIXES.get(suffix)
    if name is None:
        return None
    return getattr(import_module(f"meshtide_codec.mesh_files.{name}"), f"{verb}_{name}")


_MAGICS = (
    (MAGIC, "a .tide stream, which is encoded already; meshtide decode makes a mesh of it"),
    (b"PK\x03\x04", "a zip archive"),
    (b"PK\x05\x06", "a zip archive"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"BZh", "a bzip2 archive"),
    (b"\xfd7zXZ\x00", "an xz archive"),
    (b"\x28\xb5\x2f\xfd", "a zstandard archive"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"\x89PNG", "a picture (PNG)"),
    (b"\xff\xd8\xff", "a picture (JPEG)"),
    (b"%PDF", "a document (PDF)"),
    (b"glTF", ".glb"),
    (b"ply\n", ".ply"),
    (b"ply\r", ".ply"),
)


def content_kind(head: bytes) -> str | None:
    r"""The suffix that the first bytes of a file ask for, or what they are the beginning of; None if that is open.

    A gzip archive is unpacked before it is looked at: what is one then was packed twice.

    >>> content_kind(b"glTF\x02"), content_kind(b"PK\x03\x04"), content_kind(b"# a comment")
    ('.glb', 'a zip archive', None)
    """
    return next((kind for magic, kind in _MAGICS if head.startswith(magic)), None)
