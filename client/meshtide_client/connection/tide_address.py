"""Where a `.tide` file lies by itself: on any web server, in an object store, or on this machine's disk.

`parse_address` distinguishes the three from a mesh of a meshtide server, which has more ways to be read.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from urllib.parse import unquote, urlsplit
from urllib.request import url2pathname

from meshtide_client.connection.address import MeshAddress, ServerAddress
from meshtide_client.connection.secrecy import shown_address
from meshtide_codec.argument_types import check_type
from meshtide_codec.errors import OptionError

SUFFIX = ".tide"
_NOT_IN_FILE_NAMES = re.compile(r"[^\w.-]+")
_FORMS = (
    "write it like http://localhost:8000/meshes/stanford-bunny, https://example.org/bunny.tide, "
    "s3://bucket/bunny.tide or bunny.tide"
)

Kind = Literal["web", "s3", "local"]


@dataclass(frozen=True, slots=True)
class TideAddress:
    """Where a file is.

    Args:
        kind: how it is read.
        shown: its address without what may be secret, for messages.
        location: its URL, or its path.
        mesh: its name without the suffix.

    >>> address = parse_address("https://example.org/scans/old%20vase.tide?signature=abc")
    >>> address.mesh, str(address)
    ('old vase', 'https://example.org/scans/old%20vase.tide')
    """

    kind: Kind
    shown: str
    location: str = field(repr=False)
    mesh: str

    @property
    def file_stem(self) -> str:
        """Its name as the stem of another file's name."""
        return _NOT_IN_FILE_NAMES.sub("_", self.mesh).lstrip("._") or "mesh"

    @property
    def is_loopback(self) -> bool:
        """Whether a web server is on this machine."""
        return ServerAddress(secure=False, authority=urlsplit(self.location).netloc).is_loopback

    def __str__(self) -> str:
        return self.shown


Address = MeshAddress | TideAddress


def parse_address(url: str) -> Address:
    """The mesh of a server, or the file, that `url` names.

    Raises:
        TypeError: it is no text.
        OptionError: neither; the message shows good ones.
    """
    check_type("an address", url, str)
    text = url.strip()
    scheme = text.partition(":")[0].lower() if re.match(r"[A-Za-z][A-Za-z0-9+.-]+:", text) else ""
    if scheme == "s3":
        return _in_store(text)
    if scheme == "file":
        parts = urlsplit(text)
        if parts.netloc not in {"", "localhost"}:
            raise OptionError(f"{shown_address(url)!r} names a file of another machine; {_FORMS}")
        return _local(Path(url2pathname(parts.path)), url)
    if scheme in {"http", "https"} and (found := _on_web(text)):
        return found
    if not scheme and text.endswith(SUFFIX) and "://" not in text:
        return _local(Path(text), url)
    return MeshAddress.parse(url)


def _on_web(url: str) -> TideAddress | None:
    """The file at a URL that no meshtide server would have, or None."""
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port
    except ValueError:
        return None  # the parser of meshes says what is wrong
    if not host or not parts.path.endswith(SUFFIX) or parts.fragment:
        return None
    if not parts.query:
        try:
            MeshAddress.parse(url)
        except OptionError:
            pass
        else:
            return None
    shown = f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}{parts.path}"
    return TideAddress("web", shown, url, _name(unquote(parts.path)))


def _in_store(url: str) -> TideAddress:
    parts = urlsplit(url)
    if not parts.netloc or not parts.path.endswith(SUFFIX) or parts.query or parts.fragment or "@" in parts.netloc:
        raise OptionError(f"{shown_address(url)!r} names no {SUFFIX} file of a bucket; {_FORMS}")
    return TideAddress("s3", url, url, _name(parts.path))


def _local(path: Path, url: str) -> TideAddress:
    if path.suffix.lower() != SUFFIX:
        raise OptionError(f"{shown_address(url)!r} does not end with {SUFFIX}; {_FORMS}")
    return TideAddress("local", str(path), str(path), path.stem)


def _name(path: str) -> str:
    return path.rpartition("/")[2].removesuffix(SUFFIX) or "mesh"
