"""Random numbers that belong to one packet: the same whatever happened to other packets, in whatever order.

Each number is made from a BLAKE2b hash of seed, model and packet. Two models of a chain draw independent numbers; a
model whose parameters change keeps its numbers, so that curves over a parameter share their noise.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def packet_generator(seed: int, model: str, packet: int) -> np.random.Generator:
    """The generator of one packet.

    Args:
        seed: of the whole link.
        model: name of the model, with its number if a chain has several of a kind.
        packet: index in the stream's packet table.

    >>> packet_generator(1, "loss", 0).random() == packet_generator(1, "loss", 0).random()
    True
    """
    key = hashlib.blake2b(f"{seed}/{model}/{packet}".encode(), digest_size=16).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(key, "little")))


def packet_uniforms(seed: int, model: str, packet: int, count: int) -> NDArray[np.float64]:
    """(count,) numbers evenly distributed in [0, 1)."""
    return packet_generator(seed, model, packet).random(count)
