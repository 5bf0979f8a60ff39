"""Equal points become one, whatever their hash."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from meshtide_codec.mesh_files import welding
from meshtide_codec.mesh_files.welding import welded

points = st.sampled_from([np.float32, np.float64]).flatmap(
    lambda kind: arrays.arrays(
        kind, st.tuples(st.integers(0, 30), st.just(3)), elements=st.sampled_from([0.0, -0.0, 1.0, 0.5])
    )
)


@given(points, st.booleans())
def test_the_first_of_equal_points_stays(table: np.ndarray, collide: bool) -> None:
    with pytest.MonkeyPatch.context() as patch:
        if collide:
            patch.setattr(welding, "_hashed", lambda bits: (bits[:, 0] % 2).astype(np.uint64))
        found, numbers = welded(table)
    known: dict[tuple[float, ...], int] = {}
    expected = [known.setdefault(tuple(row), len(known)) for row in table.tolist()]
    assert numbers.tolist() == expected
    assert found.tolist() == [list(row) for row in known]
    assert found.dtype == table.dtype


def test_many_points_have_hashes_of_their_own() -> None:
    table = np.random.default_rng(0).random((50_000, 3), np.float32)
    keys = welding._hashed(np.concatenate([table, table[:100]]).view(np.uint32))
    assert len(np.unique(keys)) == 50_000
