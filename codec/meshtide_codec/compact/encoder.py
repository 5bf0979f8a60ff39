"""The compact encoder: previews, then an octree whose Maps, faces and Diffs are coded level by level.

Level l is octree depth B - l. The stream opens with the previews and one Base packet of all coarse levels; each finer
depth brings its Map&Conn while there are cells to split, and its Diff. Cost: O(n) per depth.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.diff_coder import has_diff
from meshtide_codec.compact.difference_coding import DifferenceCoder, encode_packets
from meshtide_codec.compact.display_filter import choose_strength, drawn_positions
from meshtide_codec.compact.effort import DeepLayers
from meshtide_codec.compact.mirror import find_mirror
from meshtide_codec.compact.octree import build_octree
from meshtide_codec.compact.options import PROFILE, CompactHeader, CompactOptions
from meshtide_codec.compact.preview_choice import choose_previews
from meshtide_codec.compact.previewing import GridPreview, encode_preview
from meshtide_codec.compact.previews import make_previews
from meshtide_codec.compact.reliable_coding import NO_FACES, ReliableCoder
from meshtide_codec.compact.slices import Slices, even_slices
from meshtide_codec.shown_state import ShownState
from meshtide_codec.stream.packets import Packet, PacketKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from meshtide_codec.quantize import QuantizedMesh

BASE_VERTICES = 256
"""The Base packet holds the deepest level with at most so many vertices,"""
BASE_SHARE = 8
"""or, behind a preview, the deepest with at most this fraction of all: the preview is what is looked at."""


class CompactEncoding:
    """A mesh encoded in the compact profile.

    Args:
        quantized: the mesh.
        options: how to encode it.
        progress: is told a stage and the fraction done.

    Attributes:
        profile: name of the profile.
        header: what the decoder has to know.
        packets: in transmission order.
        states: what can be shown after how many packets, in transmission order.
    """

    profile = PROFILE

    def __init__(
        self,
        quantized: QuantizedMesh,
        options: CompactOptions,
        progress: Callable[[str, float], None] | None = None,
    ) -> None:
        report = progress or (lambda _stage, _fraction: None)
        self._bits = quantized.bits
        self.packets: list[Packet] = []
        self.states: list[ShownState] = []
        report("octree", 0.0)
        self._octree = build_octree(quantized.positions, quantized.faces, quantized.bits)
        mirror = find_mirror(quantized.positions, quantized.bits) if options.mirror else None
        report("previews", 0.1)
        mesh = quantized.positions, quantized.faces, quantized.bits
        made = choose_previews(*mesh) if options.previews is None else make_previews(*mesh, options.previews)
        previews = [GridPreview(preview.bits, preview.positions, preview.faces) for preview in made]
        base_depth = self._base_depth(behind_preview=bool(previews))
        slices = self._slices(options.slices)
        report("Diffs", 0.3)
        deep = options.effort.deep_layers
        root, deep_diffs = self._octree.levels[0], DeepLayers.DIFFS in deep
        coders = [DifferenceCoder(root, slices, i, mirror, deep=deep_diffs) for i in range(len(slices))]
        diffs = encode_packets(self._octree, coders, base_depth, self._last_needed_depth(slices))
        self.header = CompactHeader(
            base_depth=base_depth,
            strengths=tuple(choose_strength(self._octree, depth) for depth in range(base_depth, self._bits + 1)),
            diff_depths=tuple(diffs),
            mirror=mirror,
            slices=slices,
            previews=len(previews),
            deep=deep,
        )
        report("levels", 0.6)
        self._send_previews(previews)
        self._send_levels(ReliableCoder(self._bits, len(quantized.positions), mirror, deep=deep), diffs)
        report("levels", 1.0)

    def _base_depth(self, *, behind_preview: bool) -> int:
        """The depth of the coarsest level that can be shown; all before it travels with it."""
        levels = self._octree.levels
        most = max(BASE_VERTICES, len(self._octree.positions) // BASE_SHARE if behind_preview else 0)
        small = [level.depth for level in levels if level.vertex_count <= most]
        first_all_leaves = next(level.depth for level in levels if level.all_leaves)
        return min(small[-1], first_all_leaves)

    def _slices(self, count: int) -> Slices:
        if count == 1:
            return Slices(self._bits)
        finest = next(level for level in self._octree.levels if level.all_leaves)
        return even_slices(finest, self._bits, count)

    def _last_needed_depth(self, slices: Slices) -> int:
        """The last depth at which a leaf is coarser than it could be."""
        needed = (
            depth
            for depth in range(self._bits, 0, -1)
            if any(has_diff(self._octree.levels[depth], slices, index) for index in range(len(slices)))
        )
        return next(needed, 0)

    def _send_previews(self, previews: list[GridPreview]) -> None:
        coarsest = self._bits - self.header.base_depth
        for place, preview in enumerate(previews):
            level = coarsest + len(previews) - place
            self._send(PacketKind.PREVIEW, level, 0, encode_preview(preview))
            draw = partial(preview.drawn, self._bits)
            self.states.append(ShownState(level, len(self.packets), len(preview.cells), preview.faces, draw))

    def _send_levels(self, reliable: ReliableCoder, diffs: dict[int, list[bytes]]) -> None:
        """All levels from the coarsest on; a state is listed wherever a level gains something."""
        known_depth = 0
        for depth in range(self.header.base_depth, self._bits + 1):
            sent = len(self.packets)
            coarse, fine = self._octree.levels[max(depth - 1, 0)], self._octree.levels[depth]
            if depth == self.header.base_depth:
                self._send(PacketKind.BASE, self._bits - depth, 0, reliable.encode_base(self._octree, depth))
            elif not coarse.all_leaves:
                self._send(PacketKind.MAP_CONN, self._bits - depth, 0, reliable.encode_map_conn(coarse, fine))
            if depth in diffs:
                for index, payload in enumerate(diffs[depth]):
                    self._send(PacketKind.DIFF, self._bits - depth, index, payload)
                known_depth = depth
            if len(self.packets) > sent or depth == self._bits:
                faces = NO_FACES if fine.faces is None else fine.faces
                draw = partial(self._drawn, depth, known_depth)
                self.states.append(ShownState(self._bits - depth, len(self.packets), fine.vertex_count, faces, draw))

    def _drawn(self, depth: int, known_depth: int) -> NDArray[np.float64]:
        """What a decoder draws of the level at `depth` that has all Diffs down to `known_depth`."""
        level = self._octree.levels[depth]
        depths = np.where(level.leaves, np.maximum(level.cell_depths, known_depth), depth).astype(np.uint8)
        shifts = (self._bits - depths.astype(np.int64))[:, None]
        positions = self._octree.positions[self._octree.first_vertices[depth]].astype(np.int64)
        middles = (2 * (positions >> shifts) + 1) << shifts
        strength = self.header.strengths[depth - self.header.base_depth]
        return drawn_positions(level, middles, depths, self._bits, strength)

    def _send(self, kind: PacketKind, level: int, part: int, payload: bytes) -> None:
        self.packets.append(Packet(kind, level, part, payload))
