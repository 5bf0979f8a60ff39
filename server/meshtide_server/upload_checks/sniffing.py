"""What a file is by its first bytes: formats that announce themselves, and archives, which are never meshes here."""

from __future__ import annotations

_MAGIC: tuple[tuple[bytes, str], ...] = (
    (b"PK\x03\x04", "a zip archive"),
    (b"PK\x05\x06", "a zip archive"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"BZh", "a bzip2 archive"),
    (b"\xfd7zXZ\x00", "an xz archive"),
    (b"\x28\xb5\x2f\xfd", "a zstandard archive"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"glTF", ".glb"),
    (b"ply\n", ".ply"),
    (b"ply\r", ".ply"),
)


def content_kind(head: bytes) -> str | None:
    """The suffix, or the name, of what begins with `head`; None if it could be several things.

    >>> content_kind(b"ply" + bytes([10])), content_kind(b"PK" + bytes([3, 4])), content_kind(b"v 0 0 0")
    ('.ply', 'a zip archive', None)
    """
    return next((kind for magic, kind in _MAGIC if head.startswith(magic)), None)
