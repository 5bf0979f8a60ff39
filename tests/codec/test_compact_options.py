from __future__ import annotations

import pytest

from meshtide_codec.compact.mirror import Mirror
from meshtide_codec.compact.options import CompactHeader, CompactOptions
from meshtide_codec.compact.slices import Slices
from meshtide_codec.errors import ContainerError, OptionError

PLAIN = CompactHeader(4, bytes(range(9)), (6, 9, 12), None, Slices(12), ())
FULL = CompactHeader(4, bytes(range(9)), (4, 12), Mirror(1, 77, 12), Slices(12, (0, 5, 900)), (7, 9))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"bits": 3}, "B must be"),
        ({"bits": 21}, "B must be"),
        ({"slices": 0}, "slices"),
        ({"slices": 5000}, "slices"),
        ({"previews": (64, 512)}, "coarsest preview comes first"),
        ({"previews": (64, 64)}, "coarsest preview comes first"),
        ({"previews": (1,)}, "ratios from 2 on"),
        ({"previews": tuple(range(20, 2, -1))}, "at most 8 previews"),
    ],
)
def test_options_out_of_range(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(OptionError, match=message):
        CompactOptions(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("header", [PLAIN, FULL])
def test_header_round_trip(header: CompactHeader) -> None:
    assert CompactHeader.from_options(header.to_options(), 12) == header


def test_a_plain_header_says_nothing_needless() -> None:
    assert set(PLAIN.to_options()) == {"b", "f", "d"}


@pytest.mark.parametrize(
    "change",
    [
        {"b": -1},
        {"b": 13},
        {"b": None},
        {"f": bytes(8)},
        {"f": "text"},
        {"d": bytes([2])},
        {"d": bytes([13])},
        {"d": bytes([6, 6])},
        {"d": bytes([7, 6])},
        {"d": [6]},
        {"m": [3, 0]},
        {"m": [0]},
        {"m": [0, 1 << 13]},
        {"s": []},
        {"s": [1]},
        {"s": [0, 5, 5]},
        {"s": [0, 1 << 36]},
        {"s": list(range(5000))},
        {"p": bytes([3])},
        {"p": bytes([13])},
        {"p": bytes([7] * 9)},
        {"x": 0},
    ],
    ids=str,
)
def test_damaged_options_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(ContainerError):
        CompactHeader.from_options(FULL.to_options() | change, 12)


def test_missing_options_are_refused() -> None:
    with pytest.raises(ContainerError, match="options of a compact stream"):
        CompactHeader.from_options({"b": 0}, 12)
