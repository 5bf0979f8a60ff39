"""Bytes of a classic stream's geometry, added up as in the tables of the paper's section 5.

The coarsest mesh counts as raw cells of B bits per coordinate, which is what the published figures amount to (sphere:
881 bytes for 224 vertices, B = 10); connectivity is not counted there, and neither is it here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.packets import PacketKind

if TYPE_CHECKING:
    from meshtide_codec.classic.encoder import ClassicEncoding


@dataclass(frozen=True, slots=True)
class GeometryBytes:
    """The parts of a stream's geometry.

    Args:
        vertices: of the finest level; rates are per vertex of it.
        coarsest: bytes of the coarsest level's positions.
        coefficients: bytes of all Param packets.
        differences: bytes of all Diff packets.
    """

    vertices: int
    coarsest: int
    coefficients: int
    differences: int

    @property
    def total(self) -> int:
        """All three together.

        >>> GeometryBytes(vertices=100, coarsest=20, coefficients=24, differences=156).total
        200
        """
        return self.coarsest + self.coefficients + self.differences

    @property
    def rate(self) -> float:
        """Bits per vertex of the finest level."""
        return 8 * self.total / self.vertices


def geometry_bytes(encoding: ClassicEncoding, bits: int) -> GeometryBytes:
    """What the geometry of `encoding` takes; `bits` is B."""
    sizes = dict.fromkeys(PacketKind, 0)
    for packet in encoding.packets:
        sizes[packet.kind] += len(packet.payload)
    return GeometryBytes(
        vertices=len(encoding.levels[0].cells),
        coarsest=-(-3 * len(encoding.levels[-1].cells) * bits // 8),
        coefficients=sizes[PacketKind.PARAM],
        differences=sizes[PacketKind.DIFF],
    )
