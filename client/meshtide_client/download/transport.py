"""What brings a stream, one connection at a time: a websocket, or a file that is read from where it lies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Protocol

from meshtide_client.connection.tide_address import Address, TideAddress
from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_codec.stream.session import Event

TransportName = Literal["websocket", "http", "download", "local", "s3"]
TransportChoice = Literal["auto", "websocket", "http", "download"]
CHOICES: tuple[TransportChoice, ...] = ("auto", "websocket", "http", "download")


class Transport(Protocol):
    """One connection, which is opened when the first events are asked for."""

    @property
    def name(self) -> str:
        """For people and programs: websocket, http, download, s3 or local."""

    @property
    def connected(self) -> bool:
        """Whether the other side has answered."""

    @property
    def received_bytes(self) -> int:
        """Bytes of the stream that have come over it."""

    async def next_events(self) -> list[Event] | None:
        """What comes next, one event at least, or None once everything that was asked for is there.

        Raises:
            TransferError: there is no connection, or it was lost.
            ProtocolError, PeerError: what answers is something else, or it refused.
            StreamError: header or packet are damaged, cut off, or over the limits.
            Exception: whatever keeping an event raises.
        """

    async def aclose(self) -> None:
        """Hang up."""


def transports_for(address: Address, choice: str) -> Sequence[TransportName]:
    """The transports to try, one after the other.

    Raises:
        OptionError: there is no such transport, or not for this address.
    """
    if choice not in CHOICES:
        raise OptionError(f"there is no transport {choice!r}; choose one of {', '.join(CHOICES)}")
    possible: tuple[TransportName, ...] = ("websocket", "http", "download")
    if isinstance(address, TideAddress):
        possible = {"web": ("http", "download"), "s3": ("s3",), "local": ("local",)}[address.kind]  # type: ignore[assignment]
    if choice == "auto":
        return possible
    if choice not in possible:
        raise OptionError(f"{address} cannot be read by {choice}; there is {', '.join(possible)}")
    return [name for name in possible if name == choice]
