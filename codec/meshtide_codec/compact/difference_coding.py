"""Diff packets of a compact stream: one or more bit planes of one slice.

A packet that holds a single depth's bit plane is that Diff; one that holds several is so many parts. Bit planes that
are small travel together, since each packet costs about ten bytes of header.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compact.diff_coder import decode_diff, encode_diff, new_slice_state, read_diff, write_diff
from meshtide_codec.errors import DiffError
from meshtide_codec.stream.parts import split_parts
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_codec.compact.diff_coder import SliceState
    from meshtide_codec.compact.level import Level
    from meshtide_codec.compact.mirror import Mirror
    from meshtide_codec.compact.octree import Octree
    from meshtide_codec.compact.slices import Slices
    from meshtide_codec.entropy.codec import PayloadReader, PayloadWriter

SMALL_PACKET = 64
"""Bytes below which a bit plane waits for the next one."""


class DifferenceCoder:
    """Writes or reads the Diffs of one slice, coarse to fine.

    Args:
        root: the level of depth 0.
        slices: the stream's slices.
        index: which of them.
        mirror: the plane of symmetry, if one is used.
        deep: whether they are coded deeply.
    """

    def __init__(self, root: Level, slices: Slices, index: int, mirror: Mirror | None, *, deep: bool = False) -> None:
        self.state: SliceState = new_slice_state(root, slices, index, deep=deep)
        self._slices = slices
        self._index = index
        self._mirror = mirror

    def encode(self, octree: Octree, depth: int) -> bytes:
        """The bit plane of `depth`, which must be the next one."""
        return encode_diff(octree, depth, self.state, self._slices, self._index, self._mirror)

    def write(self, writer: PayloadWriter, octree: Octree, depth: int) -> None:
        """Like `encode`, into a payload that holds more."""
        write_diff(writer, octree, depth, self.state, self._slices, self._index, self._mirror)

    def read(self, reader: PayloadReader, level: Level) -> None:
        """Take the bit plane of a level, which must be the next one, from a payload that may hold more."""
        read_diff(reader, level, self.state, self._slices, self._index, self._mirror)

    def decode(self, payload: bytes, levels: Sequence[Level]) -> None:
        """Take a packet that holds the bit planes of the depths of `levels`, which must be the next ones.

        Raises:
            DiffError: the payload is damaged; bit planes before the damage are kept.
        """
        try:
            parts = split_parts(payload, len(levels))
        except BadValueError as error:
            raise DiffError(f"{error}; the stream is damaged", offset=0) from error
        for level, part in zip(levels, parts, strict=True):
            decode_diff(part, level, self.state, self._slices, self._index, self._mirror)

    @property
    def depth(self) -> int:
        """The depth of the last bit plane that was written or read."""
        return self.state.depth


def packet_depths(planes: dict[int, list[bytes]], base_depth: int, needed: int) -> list[int]:
    """At which depths Diff packets end.

    Args:
        planes: the bit planes of each depth from 1 on, slice by slice.
        base_depth: no packet ends before this depth.
        needed: the last depth whose bit plane moves any vertex, 0 if none does.

    >>> packet_depths({depth: [bytes(size)] for depth, size in enumerate([0, 9, 99, 0, 0, 20], start=1)}, 2, 6)
    [3, 6]
    """
    depths = []
    waiting = 0
    for depth in range(1, needed + 1):
        waiting += max(map(len, planes[depth]))
        if depth >= base_depth and (waiting >= SMALL_PACKET or depth == needed):
            depths.append(depth)
            waiting = 0
    if needed and needed < base_depth:
        depths.append(base_depth)
    return depths
