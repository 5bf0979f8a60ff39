"""What a receiver lacks of the packets that it asked for.

Nobody else is asked: header and bound say which packets are due, so no sender can pass off a part as the whole.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Container, Mapping

    from meshtide_codec.stream.header import PacketEntry, StreamHeader


@dataclass(frozen=True, slots=True)
class Shortage:
    """Packets that are due and not held.

    Args:
        packets: how many there are.
        wanted: how many packets are due, the held ones included.
        size: bytes of the missing ones.
        first: row of the packet table of the first one that is missing.
        kinds: how many of each kind are missing.
    """

    packets: int
    wanted: int
    size: int
    first: PacketEntry
    kinds: Mapping[str, int]

    def __str__(self) -> str:
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(self.kinds.items()))
        return (
            f"{self.packets} of {self.wanted} packets are missing "
            f"({self.size} bytes, from level {self.first.level} on: {kinds})"
        )


def find_shortage(header: StreamHeader, held: Container[int], wanted: int) -> Shortage | None:
    """What is missing of the first `wanted` packets of a stream where those at the indices `held` are there.

    >>> from meshtide_codec.encoder import encode
    >>> from meshtide_codec.mesh import Mesh
    >>> stream = encode(Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    >>> find_shortage(stream.header, range(len(stream.packets)), len(stream.packets)) is None
    True
    """
    missing = [header.packets[index] for index in range(wanted) if index not in held]
    if not missing:
        return None
    return Shortage(
        packets=len(missing),
        wanted=wanted,
        size=sum(entry.length for entry in missing),
        first=missing[0],
        kinds=Counter(entry.kind.label for entry in missing),
    )
