"""What a decoder is willing to take from a stranger: every count, length and allocation is held against these."""

from __future__ import annotations

from dataclasses import dataclass, fields

from meshtide_codec.errors import LimitError, OptionError

DECODER_BYTES_PER_VERTEX = 640
DECODER_BYTES_PER_FACE = 256
"""Upper estimates of a decoder's working memory (arrays of the finest level, its coarser levels and the coders'
own tables), used to refuse a header before anything is allocated; measured by tests/bench/memory.py."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Largest claims of a stream that a decoder accepts.

    Args:
        vertices: vertices of one level.
        faces: faces of one level.
        levels: levels of a stream.
        packets: packets of a stream.
        header_bytes: length of a stream header.
        packet_bytes: length of one packet.
        memory: bytes that decoding may take by estimate.

    >>> Limits(vertices=1000).check_mesh(2000, 0)
    Traceback (most recent call last):
    ...
    meshtide_codec.errors.LimitError: the stream claims 2000 vertices; this decoder accepts 1000 (Limits.vertices)
    """

    vertices: int = 1 << 26
    faces: int = 1 << 27
    levels: int = 64
    packets: int = 1 << 16
    header_bytes: int = 1 << 24
    packet_bytes: int = 1 << 30
    memory: int = 1 << 34

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) < 1:
                raise OptionError(f"Limits.{field.name} must be at least 1, not {getattr(self, field.name)}")

    def check_mesh(self, vertices: int, faces: int, *, level: int | None = None) -> None:
        """Raise LimitError when a level of that size, or the memory to decode it, is over the limits."""
        for name, claimed in (("vertices", vertices), ("faces", faces)):
            if claimed > getattr(self, name):
                raise LimitError(
                    f"the stream claims {claimed} {name}; this decoder accepts {getattr(self, name)} (Limits.{name})",
                    level=level,
                )
        memory = vertices * DECODER_BYTES_PER_VERTEX + faces * DECODER_BYTES_PER_FACE
        if memory > self.memory:
            raise LimitError(
                f"decoding would take about {memory} bytes; this decoder accepts {self.memory} (Limits.memory)",
                level=level,
            )
