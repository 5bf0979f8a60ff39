"""Addresses of servers and meshes: every form in which a person may write one, and every URL that is made of it.

A mesh lives at `http://host:port/meshes/ID`, where the ID of one in a subfolder holds slashes; `ws` stands for `http`
and `wss` for `https`, `/stream` or `.tide` at the end are taken off, and a path in front of `/meshes` is kept, for
servers behind a reverse proxy.
"""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from urllib.parse import quote, unquote, urlsplit

from meshtide_client.connection.secrecy import shown_address, without_secrets
from meshtide_codec.argument_types import check_type
from meshtide_codec.errors import OptionError

_SECURE = {"http": False, "ws": False, "https": True, "wss": True}
_COLLECTION = "meshes"
_EXAMPLE = "http://localhost:8000/meshes/stanford-bunny"
_SERVER_EXAMPLE = "http://localhost:8000"
_LONGEST_MESH_ID = 200
_MESH_PATH = re.compile(rf"(.*)/{_COLLECTION}/([^/]+?(?:/[^/]+?)*)(?:\.tide)?/?", re.DOTALL)
_NOT_IN_FILE_NAMES = re.compile(r"[^\w.-]+")


@dataclass(frozen=True, slots=True)
class ServerAddress:
    """Where a server is.

    Args:
        secure: whether TLS is spoken.
        authority: host, port and, in front of an @, user and password, as they stand in a URL.
        prefix: path in front of `/meshes`, empty or starting with a slash.

    >>> ServerAddress.parse("ws://localhost:8000/").listing_url
    'http://localhost:8000/meshes'
    """

    secure: bool
    authority: str
    prefix: str = ""

    @classmethod
    def parse(cls, url: str) -> ServerAddress:
        """The server of `url`, which may also name one of its meshes.

        Raises:
            OptionError: not such a URL; the message shows a good one.
        """
        server, path = _split(url, _SERVER_EXAMPLE)
        prefix, _, _ = path.partition(f"/{_COLLECTION}")
        return cls(server.secure, server.authority, prefix.rstrip("/"))

    @property
    def listing_url(self) -> str:
        """Where the server lists its meshes."""
        return self._url("http", f"/{_COLLECTION}")

    @property
    def is_loopback(self) -> bool:
        """Whether the server is on this machine, so that no proxy can stand between."""
        host = urlsplit(f"//{self.authority}").hostname or ""
        try:
            return ipaddress.ip_address(host).is_loopback
        except ValueError:
            return host == "localhost"

    def mesh(self, mesh: str) -> MeshAddress:
        """The address of one of the server's meshes."""
        return MeshAddress(self, mesh)

    def _url(self, scheme: str, path: str) -> str:
        return f"{scheme}{'s' if self.secure else ''}://{self.authority}{self.prefix}{path}"

    def __str__(self) -> str:
        return f"http{'s' if self.secure else ''}://{self.authority.rpartition('@')[2]}{self.prefix}"


@dataclass(frozen=True, slots=True)
class MeshAddress:
    """Where a mesh is.

    Args:
        server: its server.
        mesh: its id there, not percent-encoded.

    >>> address = MeshAddress.parse("https://example.org/tide/meshes/old%20vase/stream")
    >>> address.mesh, address.stream_url
    ('old vase', 'wss://example.org/tide/meshes/old%20vase/stream')
    """

    server: ServerAddress
    mesh: str

    @classmethod
    def parse(cls, url: str) -> MeshAddress:
        """The mesh that `url` names.

        Raises:
            OptionError: not such a URL; the message shows a good one.
        """
        server, path = _split(url, _EXAMPLE)
        found = _MESH_PATH.fullmatch(path.rstrip("/").removesuffix("/stream")) or _MESH_PATH.fullmatch(path)
        if not found:
            raise OptionError(f"{shown_address(url)!r} names no mesh; write it like {_EXAMPLE}")
        prefix, mesh = found[1], unquote(found[2])
        if len(mesh) > _LONGEST_MESH_ID:
            raise OptionError(f"the address names a mesh id of {len(mesh)} characters; {_LONGEST_MESH_ID} is the most")
        return cls(ServerAddress(server.secure, server.authority, prefix), mesh)

    @property
    def stream_url(self) -> str:
        """Where its stream is."""
        return self._url("ws", "/stream")

    @property
    def page_url(self) -> str:
        """The address itself, with what `str` leaves out of it: user and password."""
        return self._url("http", "")

    @property
    def file_url(self) -> str:
        """Where its stream lies as a file."""
        return self._url("http", ".tide")

    @property
    def file_stem(self) -> str:
        """Its id as the stem of a file name: no separators, no leading dots.

        >>> MeshAddress.parse("http://h/meshes/..%2Fvase").file_stem
        'vase'
        """
        return _NOT_IN_FILE_NAMES.sub("_", self.mesh).lstrip("._") or "mesh"

    def _url(self, scheme: str, suffix: str) -> str:
        return self.server._url(scheme, f"/{_COLLECTION}/{_quoted(self.mesh)}{suffix}")  # noqa: SLF001

    def __str__(self) -> str:
        return f"{self.server}/{_COLLECTION}/{_quoted(self.mesh)}"


def _quoted(mesh: str) -> str:
    """An id as it is in an address: slashes as they are, unless it would be read as another one then.

    >>> _quoted("my scans/bunny"), _quoted("../bunny")
    ('my%20scans/bunny', '..%2Fbunny')
    """
    plain = all(segment not in {"", ".", "..", _COLLECTION} for segment in mesh.split("/"))
    return quote(mesh, safe="/" if plain else "")


def _split(url: str, example: str) -> tuple[ServerAddress, str]:
    """The server without prefix, and the path."""
    check_type("an address", url, str)
    try:
        parts = urlsplit(url.strip())
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise OptionError(f"{without_secrets(url.strip())!r} is not an address; write it like {example}") from error
    shown = shown_address(url)
    if parts.scheme not in _SECURE or "://" not in url:
        raise OptionError(f"{shown!r} does not start with http://, https://, ws:// or wss://; write it like {example}")
    if not host or port == 0:
        raise OptionError(f"{shown!r} names no host and port to connect to; write it like {example}")
    if parts.query or parts.fragment:
        raise OptionError(f"{shown!r} has a part after ? or #, which means nothing here; write it like {example}")
    return ServerAddress(_SECURE[parts.scheme], parts.netloc), parts.path
