from __future__ import annotations

import pytest

from meshtide_codec.errors import LimitError, OptionError
from meshtide_codec.limits import Limits


def test_a_mesh_within_the_limits_passes_and_one_over_them_does_not() -> None:
    limits = Limits(vertices=100, faces=200)
    limits.check_mesh(100, 200)
    with pytest.raises(LimitError, match="claims 101 vertices"):
        limits.check_mesh(101, 0)
    with pytest.raises(LimitError, match="level 3: the stream claims 201 faces"):
        limits.check_mesh(1, 201, level=3)


def test_memory_is_a_limit_of_its_own() -> None:
    with pytest.raises(LimitError, match="decoding would take about"):
        Limits(memory=1000).check_mesh(100, 0)


def test_limits_must_be_positive() -> None:
    with pytest.raises(OptionError, match="Limits.packets"):
        Limits(packets=0)
