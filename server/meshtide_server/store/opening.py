"""From the address of a store to the store."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

from meshtide_codec.errors import OptionError
from meshtide_server.store.local import LocalStore
from meshtide_server.store.memory import MemoryStore

if TYPE_CHECKING:
    from meshtide_server.store.protocol import Store

_BUCKET = re.compile(r"[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]", re.ASCII)
_SCHEME = re.compile(r"[a-z][a-z0-9+-]+:", re.ASCII | re.IGNORECASE)
"""Two letters at least: one letter is a Windows drive."""


def open_store(url: str | os.PathLike[str]) -> Store:
    """The store at that address.

    Args:
        url: a folder's path, ``file:`` and a path, ``memory:``, or ``s3://bucket/folder``.

    Raises:
        OptionError: it is not an address of a store, or the extra that it needs is not installed.
        StoreError: the store cannot be opened.

    >>> open_store("memory:")
    MemoryStore(0 objects)
    """
    text = os.fspath(url)
    if not text:
        raise OptionError("a store needs an address: a folder, file:/a/folder, memory:, or s3://bucket/folder")
    if isinstance(url, os.PathLike) or not _SCHEME.match(text):
        return LocalStore(Path(text))
    parts = urlsplit(text)
    if parts.scheme == "memory" and text.rstrip("/") == "memory:":
        return MemoryStore()
    if parts.scheme == "file" and parts.netloc in {"", "localhost"} and parts.path:
        return LocalStore(Path(unquote(parts.path)))
    if parts.scheme == "s3" and _BUCKET.fullmatch(parts.netloc) and not (parts.query or parts.fragment):
        from meshtide_server.store.s3 import S3Store  # noqa: PLC0415 - needs an extra

        return S3Store(parts.netloc, parts.path.strip("/"))
    raise OptionError(
        f"{_without_secrets(text)!r} is not a store: a folder, file:/a/folder, memory:, s3://bucket/folder"
    )


def _without_secrets(url: str) -> str:
    """A URL without what may be a password: what comes before an @, or after a question mark."""
    return re.sub(r"//[^/@]*@", "//...@", url).split("?", maxsplit=1)[0]
