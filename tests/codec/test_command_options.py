from __future__ import annotations

import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.command_options import number_list, profile_options
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.errors import OptionError
from meshtide_codec.filters import FilterSpec

NOTHING = {"filter": None, "degree": None}


def test_each_profile_takes_its_own_options() -> None:
    compact = profile_options("compact", 10, {"previews": "300,30", "slices": 2}, NOTHING)
    assert compact == CompactOptions(bits=10, previews=(300, 30), slices=2)
    assert profile_options("compact", 12, {"previews": "none"}, NOTHING) == CompactOptions(previews=())
    classic = profile_options("classic", 9, {}, {"filter": "taubin", "drop_bits": 2, "sent_levels": "0,2"})
    assert classic == ClassicOptions(bits=9, drop_bits=2, sent_levels=frozenset({0, 2}), filter=FilterSpec("taubin"))
    assert profile_options("classic", 12, {}, {"degree": 5}) == ClassicOptions(filter=FilterSpec(degree=5))


@pytest.mark.parametrize(
    ("profile", "compact", "classic", "message"),
    [
        ("magic", {}, {}, "--profile is compact or classic, not 'magic'"),
        ("compact", {}, {"degree": 3}, "--degree belongs to profile classic; add --profile classic"),
        ("classic", {"slices": 3}, {}, "--slices belongs to profile compact; add --profile compact"),
        (
            "compact",
            {},
            {"variable_from": 3, "sent_levels": "1"},
            "-S and --diff-levels belong to profile classic",
        ),
        ("compact", {"slices": 0}, {}, "slices"),
    ],
)
def test_foreign_and_wrong_options_are_refused(
    profile: str, compact: dict[str, object], classic: dict[str, object], message: str
) -> None:
    with pytest.raises(OptionError, match=message):
        profile_options(profile, 12, compact, classic)


def test_lists_of_numbers() -> None:
    assert number_list("0, 2,3") == (0, 2, 3)
    assert number_list("") == ()
    with pytest.raises(OptionError, match="written like"):
        number_list("a,b")
