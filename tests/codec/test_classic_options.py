from __future__ import annotations

import pytest

from meshtide_codec.classic.options import ClassicHeader, ClassicOptions
from meshtide_codec.errors import ContainerError, OptionError
from meshtide_codec.filters import FilterSpec

HEADER = ClassicHeader((0, 2, 3), FilterSpec("polynomial", degree=2), frozenset({0, 1}))


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


def test_header_round_trip() -> None:
    assert ClassicHeader.from_options(HEADER.to_options(), 12) == HEADER


@pytest.mark.parametrize(
    "change",
    [
        {"shifts": []},
        {"shifts": [1, 2]},
        {"shifts": [0, 2, 2]},
        {"shifts": [0, 13]},
        {"shifts": "0"},
        {"diffs": [2]},
        {"diffs": [-1]},
        {"diffs": 3},
        {"filter": {}},
        {"filter": None},
        {"unknown": 1},
    ],
)
def test_damaged_options_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(ContainerError):
        ClassicHeader.from_options(HEADER.to_options() | change, 12)


def test_missing_options_are_refused() -> None:
    with pytest.raises(ContainerError, match="options of a classic stream"):
        ClassicHeader.from_options({}, 12)
