"""What the rest of the codec knows of a profile: options that can encode, and the fields of its own in the header.

A further profile is a class of each of the three kinds below, a row in `stream.header.HEADERS`, and a decoder in the
core.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from dataclasses import Field

    from meshtide_codec import core
    from meshtide_codec.effort import Effort
    from meshtide_codec.packets import Packet
    from meshtide_codec.quantize import QuantizedMesh
    from meshtide_codec.shown_state import ShownState


@runtime_checkable
class Profile(Protocol):
    """A way to code the levels of a mesh, with what a person has chosen of it: a frozen dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def bits(self) -> int:
        """B, quantization bits per coordinate."""

    def encode(self, quantized: QuantizedMesh, progress: Callable[[str, float], None] | None, threads: int) -> Encoding:
        """The packets of a mesh.

        Args:
            quantized: the mesh.
            progress: called with a stage and the fraction done.
            threads: how many may work at once.
        """


class Encoding(Protocol):
    """A mesh encoded in a profile."""

    @property
    def header(self) -> ProfileHeader:
        """What the decoder has to know."""

    @property
    def packets(self) -> list[Packet]:
        """In transmission order."""

    @property
    def states(self) -> Sequence[ShownState]:
        """What can be shown after how many packets, in transmission order."""


class ProfileHeader(Protocol):
    """The fields of a profile in the stream's header: what its decoder needs to know."""

    profile: ClassVar[str]
    """The name of the profile,"""
    number: ClassVar[int]
    """and what stands for it in a header."""

    @property
    def effort(self) -> Effort | None:
        """The effort at which the stream was encoded; None: its profile knows none."""

    @property
    def trained_states(self) -> tuple[int, ...]:
        """The trained states that its decoder starts from, as `core.states` numbers them."""

    def plain(self) -> dict[str, Any]:
        """The fields as JSON can hold them, without those that follow from the packet table."""

    def fill(self, header: core.Header) -> object:
        """Copy the fields into the core's header; returns what must stay alive until it is written."""
