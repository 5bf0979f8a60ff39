"""What a client can show after some packets of a stream: encoders list these states, headers describe them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class ShownState:
    """A mesh that can be shown.

    Args:
        level: its level.
        packet_count: how many packets, in transmission order, it needs.
        vertices: its vertex count.
        faces: its face count.
        draw: gives what a decoder draws: positions, (n, 3) float64 in finest steps, and faces, (m, 3) int32.
    """

    level: int
    packet_count: int
    vertices: int
    faces: int
    draw: Callable[[], tuple[NDArray[np.float64], NDArray[np.int32]]]
