"""What the Diffs of a classic stream look like, level by level (paper, sections 4.3 and 5).

Bits spent beside Shannon's bound, the power law of eq. (20) fitted to the Diffs, and their l2 norm per vertex as the
paper's tables print it. Reading the Diffs of a stream costs O(n); nothing else of it is decoded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.classic.level_coding import decode_diff
from meshtide_codec.classic.options import ClassicHeader
from meshtide_codec.errors import OptionError
from meshtide_codec.packets import PacketKind
from meshtide_codec.statistics import fit_power_law, l2_error_per_vertex, shannon_bound_bits

if TYPE_CHECKING:
    from collections.abc import Iterable

    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import StreamHeader


@dataclass(frozen=True, slots=True)
class DifferenceStatistics:
    """The Diffs of one level.

    Args:
        level: number of the level.
        vertices: how many vertices have a Diff.
        bits: size of the Diff packet's payload.
        shannon_bits: least size by an order-0 coder with one model a coordinate.
        alpha: exponent of the fitted power law, 1 Laplace's, 2 that of Gauss.
        a: its inverse scale, in 1 / steps^alpha; infinite if all Diffs are zero.
        l2_error_per_vertex: l2 norm of the Diffs divided by the number of vertices, in units of the cube.
    """

    level: int
    vertices: int
    bits: int
    shannon_bits: float
    alpha: float
    a: float
    l2_error_per_vertex: float


def difference_statistics(header: StreamHeader, packets: Iterable[Packet]) -> list[DifferenceStatistics]:
    """Statistics of each Diff packet in `packets`, in their order.

    Raises:
        DiffError: the stream is damaged.
        OptionError: it is of another profile.
    """
    if not isinstance(header.options, ClassicHeader):
        raise OptionError("only Diffs of profile classic are numbers; those of other profiles are bit planes")
    shifts = header.options.shifts
    rows = []
    for packet in packets:
        if packet.kind is not PacketKind.DIFF:
            continue
        vertices = header.entry(packet.level).vertices
        differences = decode_diff(packet.payload, vertices, packet.level)
        law = fit_power_law(differences)
        step = (1 << shifts[packet.level]) / ((1 << header.bits) - 1)
        rows.append(
            DifferenceStatistics(
                level=packet.level,
                vertices=vertices,
                bits=8 * len(packet.payload),
                shannon_bits=shannon_bound_bits(differences),
                alpha=law.alpha,
                a=law.a,
                l2_error_per_vertex=l2_error_per_vertex(differences, step),
            )
        )
    return rows
