from __future__ import annotations

import struct

from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.reference.header import distances as reference_distances
from meshtide_codec.stream.distances import LARGEST, stored_distances

SHOWN = st.floats(1e-9, LARGEST)


@given(SHOWN, st.floats(1.0, 180.0))
def test_stored_distances_are_a_little_too_large_and_never_too_small(rms: float, factor: float) -> None:
    maximum = min(rms * factor, LARGEST)
    stored_rms, stored_maximum = stored_distances(rms, maximum)
    assert rms <= stored_rms <= rms * (1 + 1 / 64)
    assert maximum <= stored_maximum <= maximum * (1 + 1 / 64) * (1 + 1 / 4)
    assert stored_distances(stored_rms, stored_maximum) == (stored_rms, stored_maximum)


WORDS = [reference_distances(struct.pack(">H", word)) for word in range(1 << 16)]


@given(st.sampled_from(WORDS[1:]))
def test_what_a_word_tells_is_stored_as_it_is(told: tuple[float, float]) -> None:
    assert stored_distances(*told) == told


@given(SHOWN, st.floats(1.0, 180.0))
def test_no_word_that_is_not_below_is_nearer(rms: float, factor: float) -> None:
    maximum = min(rms * factor, LARGEST)
    assert stored_distances(rms, maximum) == min(told for told in WORDS if told[0] >= rms and told[1] >= maximum)


def test_the_ends_of_the_scale() -> None:
    assert stored_distances(0.0, 0.0) == (0.0, 0.0)
    smallest, _ = stored_distances(5e-324, 5e-324)
    assert 0.0 < smallest < 1e-9
    assert stored_distances(0.0, 1e-12)[0] == smallest
    assert stored_distances(1e30, 1e30) == (LARGEST, LARGEST)
    assert stored_distances(1e-6, 1.0) == (stored_distances(1e-6, 1e-6)[0], LARGEST)
    assert stored_distances(0.5, 0.1) == (0.5, 0.5)
