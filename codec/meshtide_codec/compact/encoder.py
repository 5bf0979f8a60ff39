"""The compact encoder: previews, then an octree whose Maps, faces and Diffs are coded level by level.

Level l is octree depth B - l. The stream opens with the previews and one Base packet of all coarse levels; each finer
depth brings its Map&Conn while there are cells to split, and its Diff. The core codes; what is decided stands here: the
base depth, the slices, which bit planes travel together, what is drawn of a level. Cost: O(n) per depth.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.mirror import find_mirror
from meshtide_codec.compact.octree_encoder import OctreeEncoder
from meshtide_codec.compact.options import CompactHeader, CompactOptions
from meshtide_codec.compact.previews import choose_previews, make_previews
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.quantize import morton_codes
from meshtide_codec.shown_state import ShownState

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from meshtide_codec.compact.previews import Preview
    from meshtide_codec.quantize import QuantizedMesh

BASE_VERTICES = 256
"""The Base packet holds the deepest level with at most so many vertices,"""
BASE_SHARE = 8
"""or, behind a preview, the deepest with at most this fraction of all: the preview is what is looked at."""
SMALL_PACKET = 64
"""Bytes below which bit planes wait for the next one: each packet costs about ten bytes of header."""


class CompactEncoding:
    """A mesh encoded in the compact profile.

    Args:
        quantized: the mesh.
        options: how to encode it.
        progress: called with a stage and the fraction done.
        threads: how many may work at once.

    Attributes:
        header: what the decoder has to know.
        packets: in transmission order.
        states: what can be shown after how many packets, in transmission order.

    Raises:
        MeshError: the mesh is not as `quantize` makes them.
    """

    def __init__(
        self,
        quantized: QuantizedMesh,
        options: CompactOptions,
        progress: Callable[[str, float], None] | None = None,
        threads: int = 1,
    ) -> None:
        report = progress or (lambda _stage, _fraction: None)
        self._bits = quantized.bits
        self._vertices = len(quantized.positions)
        self.packets: list[Packet] = []
        self.states: list[ShownState] = []
        report("octree", 0.0)
        mesh = quantized.positions, quantized.faces, quantized.bits
        with ThreadPoolExecutor(1) as aside:

            def work() -> list[Preview]:
                return choose_previews(*mesh) if options.previews is None else make_previews(*mesh, options.previews)

            chosen = aside.submit(work) if threads > 1 else None
            mirror = find_mirror(quantized.positions, quantized.bits) if options.mirror else None
            slices = even_slices(quantized.positions, options.slice_count(self._vertices))
            self._core = OctreeEncoder(*mesh, effort=options.effort, mirror=mirror, slices=slices)
            strengths = self._core.strengths(0)
            report("previews", 0.1)
            previews = work() if chosen is None else chosen.result()
        base_depth = self._base_depth(behind_preview=bool(previews))
        self._strengths = strengths[base_depth:]
        self._send_previews(previews, base_depth)
        report("levels", 0.5)
        diff_depths = self._send_levels(base_depth, len(slices), report)
        self._core.finish()
        self.header = CompactHeader(
            base_depth=base_depth,
            strengths=self._strengths,
            diff_depths=tuple(diff_depths),
            mirror=mirror,
            slices=slices,
            previews=len(previews),
            effort=options.effort,
        )
        report("levels", 1.0)

    def _base_depth(self, *, behind_preview: bool) -> int:
        """The depth of the coarsest level that can be shown; all before it travels with it."""
        most = max(BASE_VERTICES, self._vertices // BASE_SHARE if behind_preview else 0)
        cells = self._core.cells
        small = max(depth for depth, count in enumerate(cells) if count <= most)
        return min(small, cells.index(self._vertices))

    def _send_previews(self, previews: list[Preview], base_depth: int) -> None:
        coarsest = self._bits - base_depth
        for place, preview in enumerate(previews):
            level = coarsest + len(previews) - place
            self._send(PacketKind.PREVIEW, level, 0, preview.payload)
            draw = partial(_drawn_preview, preview, self._bits)
            sizes = len(preview.positions), len(preview.faces)
            self.states.append(ShownState(level, len(self.packets), *sizes, draw))

    def _send_levels(self, base_depth: int, slices: int, report: Callable[[str, float], None]) -> list[int]:
        """All levels from the coarsest on; a state is listed wherever a level gains something.

        Returns the depths at which Diffs end.
        """
        diff_depths: list[int] = []
        for depth in range(base_depth, self._bits + 1):
            sent, level = len(self.packets), self._bits - depth
            if depth == base_depth:
                self._send(PacketKind.BASE, level, 0, self._core.base(depth))
            elif self._core.cells[depth - 1] < self._vertices:
                self._send(PacketKind.MAP_CONN, level, 0, self._core.next_level())
            longest = max(self._core.add_planes(part, depth) for part in range(slices))
            if longest >= SMALL_PACKET or (depth == self._bits and longest > 0):
                diff_depths.append(depth)
                for part in range(slices):
                    self._send(PacketKind.DIFF, level, part, self._core.take_planes(part))
            if len(self.packets) > sent or depth == self._bits:
                known_depth = diff_depths[-1] if diff_depths else 0
                draw = partial(self._core.drawn, depth, known_depth, self._strengths[depth - base_depth])
                sizes = self._core.cells[depth], self._core.faces[depth]
                self.states.append(ShownState(level, len(self.packets), *sizes, draw))
            report("levels", 0.5 + 0.5 * self._core.cells[depth] / self._vertices)
        return diff_depths

    def _send(self, kind: PacketKind, level: int, part: int, payload: bytes) -> None:
        self.packets.append(Packet(kind, level, part, payload))


def even_slices(positions: NDArray[np.int32], count: int) -> tuple[int, ...]:
    """Where at most `count` slices of equally many vertices begin: the first Morton code of each, ascending from 0.

    Args:
        positions: (n, 3) int32 in Morton order.
        count: at least 1.

    >>> even_slices(np.array([[0, 0, 0], [0, 0, 1], [0, 1, 0], [1, 1, 1]], np.int32), 2)
    (0, 2)
    """
    places = [len(positions) * part // count for part in range(1, count)]
    codes = morton_codes(positions[places]) if places else np.zeros(0, np.uint64)
    return (0, *sorted(set(codes.tolist()) - {0}))


def _drawn_preview(preview: Preview, bits: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    return preview.vertices(bits), preview.faces
