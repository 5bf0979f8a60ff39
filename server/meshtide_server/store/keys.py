"""Keys of objects: short paths of lower-case names, safe in every store, on every disk and in every URL.

A key is made of segments with "/" between them. A segment holds a-z, 0-9, ".", "_" and "-", and begins with a letter
or a digit: no segment is "..", none is hidden, and two keys never become one on a disk that ignores case. No key may be
a folder of another one ("a" and "a/b"), for a disk cannot hold both.
"""

from __future__ import annotations

import re

from meshtide_server.store.errors import InvalidKeyError

LONGEST_KEY = 512
LONGEST_SEGMENT = 128
"""Characters of a segment; every file system takes 255."""
SOURCES = "sources"
"""The folder of uploaded files."""
_SEGMENT = re.compile(r"[a-z0-9][a-z0-9._-]*", re.ASCII)
_DIGEST = re.compile(r"[0-9a-f]{64}", re.ASCII)
_SUFFIX = re.compile(r"(?:\.[a-z0-9]{1,10}(?:\.gz)?)?", re.ASCII)


def check_key(key: str) -> str:
    """`key`, if it is one.

    Raises:
        InvalidKeyError: it is empty, too long, or has a segment that is not allowed.

    >>> check_key("streams/0a1b.tide")
    'streams/0a1b.tide'
    """
    if not key or len(key) > LONGEST_KEY:
        raise InvalidKeyError(f"a key has 1 to {LONGEST_KEY} characters; this one has {len(key)}")
    for segment in key.split("/"):
        if len(segment) > LONGEST_SEGMENT or not _SEGMENT.fullmatch(segment):
            raise InvalidKeyError(
                f"key {key!r}: segment {segment!r} is not 1 to {LONGEST_SEGMENT} characters of a-z, 0-9, '.', '_' and "
                "'-', beginning with a letter or a digit"
            )
    return key


def check_prefix(prefix: str) -> str:
    """A folder of keys, "" for all of them, without a slash at its end.

    Raises:
        InvalidKeyError: it is not the beginning of a key.

    >>> check_prefix("streams/"), check_prefix("")
    ('streams', '')
    """
    folder = prefix.removesuffix("/")
    return check_key(folder) if folder or prefix else ""


def stream_key(sha256: str) -> str:
    """The key of a stream.

    Args:
        sha256: of the whole `.tide` file, in hexadecimal.

    Raises:
        InvalidKeyError: it is not a digest.

    >>> stream_key("0a" * 32)[:14], stream_key("0a" * 32)[-7:]
    ('streams/0a0a0a', '0a.tide')
    """
    return f"streams/{_checked_digest(sha256)}.tide"


def source_key(sha256: str, suffix: str) -> str:
    """The key of an uploaded file that waits to be encoded.

    Args:
        sha256: of the file, in hexadecimal.
        suffix: of its name, such as ".obj" or ".obj.gz"; capitals become small.

    Raises:
        InvalidKeyError: it is not a digest, or not a suffix.

    >>> source_key("0a" * 32, ".OBJ")[-8:], suffix_of(source_key("0a" * 32, ".obj.gz"))
    ('0a0a.obj', '.obj.gz')
    """
    small = suffix.lower()
    if not _SUFFIX.fullmatch(small):
        raise InvalidKeyError(f"{suffix!r} is not the suffix of a file's name")
    return f"{SOURCES}/{_checked_digest(sha256)}{small}"


def suffix_of(key: str) -> str:
    """The suffix of an uploaded file, from its key.

    >>> suffix_of(source_key("0a" * 32, "")), suffix_of(source_key("0a" * 32, ".ply"))
    ('', '.ply')
    """
    _, dot, suffix = key.rpartition("/")[2].partition(".")
    return dot + suffix


def digest_of(key: str) -> str | None:
    """The SHA-256 that the bytes of an object have, in hexadecimal, if its key says.

    >>> digest_of(stream_key("0a" * 32)) == digest_of(source_key("0a" * 32, ".obj")) == "0a" * 32
    True
    >>> digest_of("notes/today.txt") is None
    True
    """
    folder, _, name = key.partition("/")
    digest = name.partition(".")[0]
    return digest if folder in {"streams", "sources"} and _DIGEST.fullmatch(digest) else None


def _checked_digest(sha256: str) -> str:
    if not _DIGEST.fullmatch(sha256):
        raise InvalidKeyError(f"{sha256!r} is not a SHA-256 in 64 hexadecimal digits")
    return sha256
