"""Mesh ids: URL-safe names made from file names, each used once.

An id holds nothing but a-z, 0-9, hyphen and underscore, so it is one path segment in every URL and can never name
a file by itself: ids are looked up in a table, not on the disk.
"""

from __future__ import annotations

import re
import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Container

LONGEST_ID = 100
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
