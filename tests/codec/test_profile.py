from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from meshtide_codec import core
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import encode
from meshtide_codec.grid import Grid
from meshtide_codec.profile import Encoding, Profile
from meshtide_codec.quantize import QuantizedMesh
from meshtide_codec.stream.header import HEADERS
from meshtide_codec.testing import grid


@dataclass(frozen=True)
class Watched:
    """A profile that another one does the work of."""

    bits: int
    seen: list[tuple[int, int]] = field(default_factory=list)

    def encode(self, quantized: QuantizedMesh, progress: Callable[[str, float], None] | None, threads: int) -> Encoding:
        self.seen.append((quantized.bits, threads))
        return CompactOptions(bits=self.bits, previews=()).encode(quantized, progress, threads)


def test_whatever_has_options_that_can_encode_is_a_profile() -> None:
    profile = Watched(9)
    assert encode(grid(12), profile, threads=3).to_bytes() == encode(grid(12), CompactOptions(9, ())).to_bytes()
    finer = encode(grid(12), profile, grid=Grid(None, None, grid(12).diagonal / 2**11), threads=1)
    assert profile.seen == [(9, 3), (finer.header.bits, 1)]
    assert finer.header.bits > 9


@pytest.mark.parametrize("options", [CompactOptions(bits=9), CompactOptions(9, effort="high"), ClassicOptions(bits=9)])  # type: ignore[arg-type]
def test_a_header_tells_what_its_decoder_starts_from(options: Profile) -> None:
    encoded = encode(grid(12), options)
    told = encoded.header.options
    assert HEADERS[told.number] is type(told)
    states = core.states(*told.trained_states)
    assert states.pointer
    assert np.array_equal(decode(encoded.to_bytes()).vertices, encoded.quantized.mesh().vertices)


def test_names_and_numbers_of_profiles_are_different() -> None:
    assert sorted((number, kind.profile) for number, kind in HEADERS.items()) == [(0, "classic"), (1, "compact")]
