from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec import core
from meshtide_codec.classic.options import ClassicHeader, ClassicOptions
from meshtide_codec.errors import ContainerError, OptionError
from meshtide_codec.filters import FilterSpec


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"bits": 3}, "B must be"),
        ({"bits": 21}, "B must be"),
        ({"drop_bits": 0}, "K, the bits"),
        ({"bits": 8, "drop_bits": 9}, "K, the bits"),
        ({"minimum_ratio": 0.5}, "collapse ratio"),
        ({"minimum_ratio": float("nan")}, "collapse ratio"),
        ({"coarsest_vertices": 0}, "at least 1 vertex"),
        ({"variable_from": 0}, "S must be"),
        ({"variable_from": 2, "sent_levels": frozenset({0})}, "not both"),
    ],
)
def test_options_out_of_range(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(OptionError, match=message):
        ClassicOptions(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "levels"),
    [
        (ClassicOptions(), {0, 1, 2, 3}),
        (ClassicOptions(variable_from=1), {0, 1, 2, 3}),
        (ClassicOptions(variable_from=2), {0, 2, 3}),
        (ClassicOptions(variable_from=5), {0}),
        (ClassicOptions(variable_from=99), {0}),
        (ClassicOptions(sent_levels=frozenset({1, 3})), {1, 3}),
        (ClassicOptions(sent_levels=frozenset()), set()),
    ],
)
def test_which_of_five_levels_send_a_diff(options: ClassicOptions, levels: set[int]) -> None:
    assert options.levels_with_diff(5) == levels


def test_levels_that_there_are_not() -> None:
    with pytest.raises(OptionError, match="predicted levels"):
        ClassicOptions(sent_levels=frozenset({4})).levels_with_diff(5)


specs = st.one_of(
    st.builds(FilterSpec, st.sampled_from(["zeroth", "gaussian"])),
    st.builds(FilterSpec, st.just("taubin"), taubin_lambda=st.floats(0, 2), taubin_mu=st.floats(0, 2)),
    st.builds(
        FilterSpec,
        st.just("polynomial"),
        st.integers(0, 15),
        st.sampled_from(["power", "chebyshev"]),
        st.one_of(st.floats(1, 2), st.just(math.inf)),
    ),
    st.builds(FilterSpec, st.just("rational"), st.integers(0, 15), denominator_degree=st.integers(1, 4)),
)


@given(specs, st.sets(st.integers(1, 20)), st.sets(st.integers(0, 19)))
def test_the_header_of_the_core_tells_all_of_it(spec: FilterSpec, shifts: set[int], diffs: set[int]) -> None:
    header = ClassicHeader((0, *sorted(shifts)), spec, frozenset(level for level in diffs if level < len(shifts)))
    told = core.Header()
    header.fill(told)
    assert ClassicHeader.of(told) == header


def test_a_filter_that_cannot_be_is_a_damaged_header() -> None:
    told = core.Header()
    ClassicHeader((0,), FilterSpec("taubin"), frozenset()).fill(told)
    told.taubin_mu = math.nan
    with pytest.raises(ContainerError, match="taubin_mu"):
        ClassicHeader.of(told)
