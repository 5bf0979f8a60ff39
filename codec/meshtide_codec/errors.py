"""Every error that meshtide raises on purpose, in one tree.

::

    MeshtideError
    ├── MeshError                  the input mesh is not usable (NaN, index out of range, empty)
    │   └── MeshFileError          a file cannot be read or written as a mesh
    ├── CoreError                  the compiled core is missing, older than its sources, or not for this machine
    ├── OptionError                an option is outside of its range (also a ValueError)
    │   └── MissingLibraryError    what is asked for takes a library that is not installed
    ├── StreamError                bytes that are damaged, cut off, or not a meshtide stream
    │   ├── ContainerError         magic, version, header, packet table
    │   │   └── VersionError       the stream is of another format than this program's
    │   ├── TruncatedError         the stream ends early; what came before is usable
    │   ├── PacketError            checksum, framing or place of one packet
    │   │   ├── BaseError          contents of the coarsest mesh's packet
    │   │   ├── MapConnError       contents of a Map&Conn packet
    │   │   ├── ParamError         contents of a Param packet
    │   │   └── DiffError          contents of a Diff packet
    │   └── LimitError             the stream asks for more than the declared limits allow
    ├── ProtocolError              a wire message that is malformed or out of place
    │   └── PeerError              the other side refused: it sent an error message
    └── TransferError              the network failed; what has arrived was kept
"""

from __future__ import annotations

from copy import copy
from typing import Self

from meshtide_codec.printable import printable

_LONGEST_MESSAGE = 4000
"""Characters of a message about a peer; the peer's own words are a thousand at most."""


class MeshtideError(Exception):
    """Root of all errors that meshtide raises on purpose."""


class MeshError(MeshtideError):
    """The input mesh is not usable."""


class MeshFileError(MeshError):
    """A file cannot be read or written as a mesh."""


class CoreError(MeshtideError):
    """The compiled core is missing, is older than its sources, or cannot be loaded on this machine."""


class OptionError(MeshtideError, ValueError):
    """An option is outside of its range."""


class MissingLibraryError(OptionError):
    """What is asked for takes a library that is not installed; the message says how to install it."""


class StreamError(MeshtideError):
    """Bytes that are damaged, cut off, or not a meshtide stream.

    Args:
        message: what was wrong and what to do about it.
        level: the level that the bytes belong to, where it is known.
        packet: the name of the packet kind, where it is known.
        offset: byte offset inside the packet (or the container), where it is known.

    >>> str(StreamError("bad checksum", level=3, packet="Diff", offset=12))
    'level 3, Diff packet, byte 12: bad checksum'
    """

    def __init__(
        self, message: str, *, level: int | None = None, packet: str | None = None, offset: int | None = None
    ) -> None:
        self.level = level
        self.packet = packet
        self.offset = offset
        self.message = message
        places = []
        if level is not None:
            places.append(f"level {level}")
        if packet is not None:
            places.append(f"{packet} packet")
        if offset is not None:
            places.append(f"byte {offset}")
        super().__init__(f"{', '.join(places)}: {message}" if places else message)

    def within(self, file: str) -> Self:
        """The same error, in a message that begins with the name of the file.

        >>> str(PacketError("bad checksum", level=3).within("bunny.tide"))
        'bunny.tide: level 3: bad checksum'
        """
        named = copy(self)
        named.args = (f"{file}: {self}",)
        return named


class ContainerError(StreamError):
    """The container's magic, version, header or packet table is wrong."""


class VersionError(ContainerError):
    """The stream is of another format version than this program's: an older meshtide wrote it, or a newer one."""


class TruncatedError(StreamError):
    """The stream ends early; what came before stays usable."""


class PacketError(StreamError):
    """One packet is damaged, out of place or of an unknown kind."""


class BaseError(PacketError):
    """The contents of the coarsest mesh's packet are wrong."""


class MapConnError(PacketError):
    """The contents of a Map&Conn packet are wrong."""


class ParamError(PacketError):
    """The contents of a Param packet are wrong."""


class DiffError(PacketError):
    """The contents of a Diff packet are wrong."""


class LimitError(StreamError):
    """The stream asks for more vertices, faces or bytes than the declared limits allow."""


class ProtocolError(MeshtideError):
    r"""A wire message that is malformed or out of place.

    Its text may hold words of a stranger; it comes in one printable line, wherever it is shown or logged.

    >>> print(ProtocolError("it said: \x1b[2J"))
    it said: \x1b[2J
    """

    def __str__(self) -> str:
        return _one_line(super().__str__())


class PeerError(ProtocolError):
    """The other side refused and said why.

    Args:
        code: short machine-readable reason, such as ``unknown-mesh``.
        message: the other side's own words, as they came.
    """

    def __init__(self, code: str, message: str) -> None:
        self.code = code
        self.message = message
        super().__init__(f"{message} ({code})")


class TransferError(MeshtideError):
    """The network failed; what has arrived was kept. Its text is as printable as that of a ProtocolError."""

    def __str__(self) -> str:
        return _one_line(super().__str__())


def _one_line(text: str) -> str:
    return printable(" ".join(text.split()), _LONGEST_MESSAGE)
