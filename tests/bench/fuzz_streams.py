"""Damaged streams for the decoder: it may refuse one or decode it, but never raise anything else, hang or grow.

python tests/bench/fuzz_streams.py --seconds 600
"""

from __future__ import annotations

import sys
import warnings
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from damage import damaged
from fuzzing_files import run

from meshtide_codec.decoder import Decoder
from meshtide_codec.errors import StreamError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.container import read_available
from meshtide_codec.stream.packets import Packet

if TYPE_CHECKING:
    import random

GOLDEN = Path(__file__).parents[1] / "golden"
LIMITS = Limits(vertices=1 << 20, faces=1 << 21, memory=1 << 30)


def attempt(pick: random.Random) -> str:
    """Damage a file as a whole or the contents of its packets, whose checksums are right then, and decode it."""
    data = pick.choice(_streams())
    inside = pick.random() < 0.6
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        header, packets, problem = read_available(data if inside else damaged(pick, ".tide", data), LIMITS)
        decoder = Decoder(header, LIMITS)
        chosen = pick.randrange(max(1, len(packets)))
        for index, packet in enumerate(packets):
            payload = packet.payload
            if inside and index == chosen:
                payload = damaged(pick, ".tide", payload)
            try:
                decoder.push(Packet(packet.kind, packet.level, packet.slice, payload))
            except StreamError as error:
                problem = problem or error
        finest = decoder.finest
        if finest is not None and not np.isfinite(decoder.mesh(finest).vertices).all():
            raise AssertionError("a decoded position is not finite")
    if problem is not None:
        raise problem
    return "decoded"


@cache
def _streams() -> list[bytes]:
    return [path.read_bytes() for path in sorted(GOLDEN.glob("*.tide"))]


if __name__ == "__main__":
    sys.exit(run(__doc__, attempt, (StreamError,)))
