from __future__ import annotations

import struct

from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.reference.packed_header import distances as reference_distances
from meshtide_codec.stream.distances import LARGEST, pack_distances, stored_distances, unpack_distances

SHOWN = st.floats(1e-9, LARGEST)


@given(SHOWN, st.floats(1.0, 180.0))
def test_stored_distances_are_a_little_too_large_and_never_too_small(rms: float, factor: float) -> None:
    maximum = min(rms * factor, LARGEST)
    stored_rms, stored_maximum = stored_distances(rms, maximum)
    assert rms <= stored_rms <= rms * (1 + 1 / 64)
    assert maximum <= stored_maximum <= maximum * (1 + 1 / 64) * (1 + 1 / 4)
    assert stored_distances(stored_rms, stored_maximum) == (stored_rms, stored_maximum)


@given(st.integers(0, 65535))
def test_every_word_is_read_as_the_reference_reads_it(word: int) -> None:
    data = struct.pack(">H", word)
    assert unpack_distances(data) == reference_distances(data)


def test_larger_codes_are_larger_distances() -> None:
    distances = [unpack_distances(struct.pack(">H", code << 5)) for code in range(2048)]
    assert distances == sorted(set(distances))
    maxima = [unpack_distances(struct.pack(">H", 99 << 5 | code))[1] for code in range(32)]
    assert maxima == sorted(set(maxima))


def test_the_ends_of_the_scale() -> None:
    assert pack_distances(0.0, 0.0) == b"\0\0"
    smallest, _ = stored_distances(5e-324, 5e-324)
    assert 0.0 < smallest < 1e-9
    assert stored_distances(0.0, 1e-12)[0] == smallest
    assert stored_distances(1e30, 1e30) == (LARGEST, LARGEST)
    assert stored_distances(1e-6, 1.0) == (stored_distances(1e-6, 1e-6)[0], LARGEST)
    assert stored_distances(0.5, 0.1) == (0.5, 0.5)
