from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.classic.encoder import ClassicEncoding
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.encoder import describe, encode
from meshtide_codec.errors import OptionError
from meshtide_codec.quantize import quantize
from meshtide_codec.report.difference_statistics import difference_statistics
from meshtide_codec.testing import grid


def test_statistics_are_those_of_the_encoders_own_diffs() -> None:
    quantized = quantize(grid(40), 10)
    encoding = ClassicEncoding(quantized, ClassicOptions(bits=10, coarsest_vertices=30))
    encoded = describe(encoding, quantized)
    rows = difference_statistics(encoded.header, encoded.packets)
    assert [row.level for row in rows] == sorted(encoding.differences, reverse=True)
    for row in rows:
        differences = encoding.differences[row.level]
        step = 2 ** encoding.levels[row.level].shift / (2**10 - 1)
        assert row.vertices == len(differences)
        assert row.l2_error_per_vertex == pytest.approx(np.linalg.norm(differences) * step / len(differences))
        counts = [np.unique(column, return_counts=True)[1] for column in differences.T]
        entropy = -sum((count * np.log2(count / count.sum())).sum() for count in counts)
        assert row.shannon_bits == pytest.approx(entropy)
    finest = rows[-1]
    assert 0.8 * finest.shannon_bits < finest.bits < 1.1 * finest.shannon_bits + 500
    assert 0.2 <= finest.alpha <= 4.0
    assert finest.a > 0


def test_bit_planes_are_refused() -> None:
    encoded = encode(grid(5))
    with pytest.raises(OptionError, match="bit planes"):
        difference_statistics(encoded.header, encoded.packets)
