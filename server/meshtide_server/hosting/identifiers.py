"""Mesh ids: URL-safe names made from file names, each used once.

A name holds nothing but a-z, 0-9, hyphen and underscore. An id is such a name, one path segment in every URL; of a mesh
in a subfolder, it is the names of the folders and its own, with slashes between. It can never name a file by itself:
ids are looked up in a table, not on the disk.
"""

from __future__ import annotations

import re
import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Container, Sequence

LONGEST_ID = 100
"""Letters of a name; one that others share has a few more."""
LONGEST_FOLDERS = 90
"""Letters of all folders of an id together: with its name, it keeps to the 200 that the wire protocol knows."""
_ADDRESSES = frozenset({"header", "stream"})
"""What may stand behind an id in an address, and so at the end of no id with slashes."""
_ID = re.compile(r"[a-z0-9_][a-z0-9_-]{0,127}", re.ASCII)
_FOREIGN = re.compile(r"[^a-z0-9_]+")


def is_id(text: str) -> bool:
    """Whether a mesh can have `text` as its id.

    >>> is_id("stanford-bunny"), is_id("../etc"), is_id("")
    (True, False, False)
    """
    return _ID.fullmatch(text) is not None


def slug(name: str, longest: int = LONGEST_ID) -> str:
    """`name` in URL-safe letters; "mesh" if nothing is left of it.

    >>> slug("Stanford Bunny (2).v1"), slug("Büste"), slug("../../etc"), slug("兎")
    ('stanford-bunny-2-v1', 'buste', 'etc', 'mesh')
    """
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
    return _FOREIGN.sub("-", plain).strip("-")[:longest].rstrip("-") or "mesh"


def unique_id(stem: str, suffix: str, taken: Container[str]) -> str:
    """An id for the file `stem` + `suffix` that is not in `taken`.

    >>> [unique_id("spot", ".obj", taken) for taken in ({}, {"spot"}, {"spot", "spot-obj"})]
    ['spot', 'spot-obj', 'spot-obj-2']
    """
    first = slug(stem)
    if first not in taken:
        return first
    second = slug(f"{first[: LONGEST_ID - 20]}-{suffix.lstrip('.')}")
    number = 1
    candidate = second
    while candidate in taken:
        number += 1
        candidate = f"{second}-{number}"
    return candidate


def path_id(folders: Sequence[str], stem: str, suffix: str, taken: Container[str]) -> str:
    """An id for the file `stem` + `suffix` in subfolders that is not in `taken`.

    >>> path_id(["My Scans", "2024"], "Bunny", ".ply", {}), path_id(["a"], "header", ".obj", {})
    ('my-scans/2024/bunny', 'a/header-obj')
    """
    if not folders:
        return unique_id(stem, suffix, taken)
    width = max(LONGEST_FOLDERS // len(folders) - 1, 1)
    prefix = "/".join(slug(folder, width) for folder in folders)
    return f"{prefix}/{unique_id(stem, suffix, _Below(prefix, taken))}"


class _Below:
    """The names that are taken in a folder."""

    def __init__(self, prefix: str, taken: Container[str]) -> None:
        self._prefix = prefix
        self._taken = taken

    def __contains__(self, name: object) -> bool:
        return name in _ADDRESSES or f"{self._prefix}/{name}" in self._taken
