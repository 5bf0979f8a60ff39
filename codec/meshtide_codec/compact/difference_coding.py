"""Diff packets of a compact stream: one or more bit planes of one slice.

Bit planes that are small travel together, since each packet costs about ten bytes of header. They are range-coded in
one go.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from meshtide_codec.compact.diff_coder import is_empty, new_slice_state, read_diff, write_diff
from meshtide_codec.entropy.codec import PayloadReader, PayloadWriter
from meshtide_codec.errors import DiffError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_codec.compact.diff_coder import SliceState
    from meshtide_codec.compact.level import Level
    from meshtide_codec.compact.mirror import Mirror
    from meshtide_codec.compact.octree import Octree
    from meshtide_codec.compact.slices import Slices

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

    def __init__(
        self,
        root: Level,
        slices: Slices,
        index: int,
        mirror: Mirror | None,
        *,
        deep: bool = False,
    ) -> None:
        self.state: SliceState = new_slice_state(root, slices, index, deep=deep)
        self._slices = slices
        self._index = index
        self._mirror = mirror

    def write(self, writer: PayloadWriter, octree: Octree, depth: int) -> None:
        """Add the bit plane of `depth`, which must be the next one, to a payload."""
        write_diff(writer, octree, depth, self.state, self._slices, self._index, self._mirror)

    def read(self, reader: PayloadReader, level: Level) -> None:
        """Take the bit plane of a level, which must be the next one, from a payload."""
        read_diff(reader, level, self.state, self._slices, self._index, self._mirror)

    def decode(self, payload: bytes, levels: Sequence[Level]) -> None:
        """Take a packet that holds the bit planes of the depths of `levels`, which must be the next ones.

        Raises:
            DiffError: the payload is damaged; none of its bit planes is kept.
        """
        if not payload and is_empty(self.state, levels[-1], self._slices, self._index):
            self.state.depth = levels[-1].depth
            return
        reader = PayloadReader(payload)
        before = replace(self.state)
        for level in levels:
            self.read(reader, level)
        if not reader.finished:
            self.state = before
            raise DiffError(
                f"bytes follow the last bit plane of slice {self._index}; the stream is damaged", offset=reader.offset
            )

    @property
    def depth(self) -> int:
        """The depth of the last bit plane that was written or read."""
        return self.state.depth


def encode_packets(
    octree: Octree, coders: Sequence[DifferenceCoder], base_depth: int, needed: int
) -> dict[int, list[bytes]]:
    """The Diff packets by the depth at which they end, slice by slice.

    Args:
        octree: the mesh.
        coders: of all slices, before their first bit planes.
        base_depth: no packet ends before this depth.
        needed: the last depth whose bit plane moves any vertex, 0 if none does.
    """
    packets: dict[int, list[bytes]] = {}
    writers = [PayloadWriter() for _ in coders]
    last = max(needed, base_depth) if needed else 0
    for depth in range(1, last + 1):
        for coder, writer in zip(coders, writers, strict=True):
            coder.write(writer, octree, depth)
        if depth == last or (depth >= base_depth and max(writer.size for writer in writers) >= SMALL_PACKET):
            packets[depth] = [writer.payload() for writer in writers]
            writers = [PayloadWriter() for _ in coders]
    return packets
