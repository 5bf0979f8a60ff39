from __future__ import annotations

import inspect

import pytest

from meshtide_codec import errors
from meshtide_codec.errors import (
    MapConnError,
    MeshtideError,
    OptionError,
    PeerError,
    ProtocolError,
    StreamError,
    TransferError,
)
from meshtide_codec.printable import printable


def test_every_error_stands_in_the_drawn_tree_at_its_place() -> None:
    assert errors.__doc__ is not None
    depths = {}
    for line in errors.__doc__.splitlines():
        name = line.strip("│├└─ ").split(" ")[0]
        if name.endswith("Error"):
            depths[name] = (len(line) - len(line.lstrip("│├└─ "))) // 4
    classes = {
        name: kind for name, kind in inspect.getmembers(errors, inspect.isclass) if kind.__module__ == errors.__name__
    }
    assert set(depths) == set(classes)
    for name, kind in classes.items():
        ancestors = [base for base in kind.__mro__[1:] if issubclass(base, MeshtideError)]
        assert depths[name] - depths["MeshtideError"] == len(ancestors), name


def test_a_stream_error_names_its_place() -> None:
    error = MapConnError("child count 9 exceeds 8", level=3, packet="Map&Conn", offset=512)
    assert str(error) == "level 3, Map&Conn packet, byte 512: child count 9 exceeds 8"
    assert (error.level, error.packet, error.offset) == (3, "Map&Conn", 512)
    assert str(StreamError("short")) == "short"


def test_an_option_error_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="B"):
        raise OptionError("B")


def test_a_peer_error_carries_its_code() -> None:
    assert PeerError("unknown-mesh", "there is no mesh 'x'").code == "unknown-mesh"


@pytest.mark.parametrize(
    "error",
    [
        PeerError("gone\x1b[2J", "see \u202eeno\x07\r\nmeshtide: all is well"),
        ProtocolError("closed: \x1b]0;title\x07 \u2066x"),
        TransferError("lost (\x9b31m red \udc80)"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_what_a_peer_said_is_told_in_one_printable_line(error: MeshtideError) -> None:
    told = str(error)
    assert told == printable(told, 10**6)
    assert told.isprintable()
    assert f"{error}" == told


def test_the_words_of_a_peer_are_kept_for_programs() -> None:
    error = PeerError("gone", "see\x1b[2J")
    assert (error.code, error.message) == ("gone", "see\x1b[2J")
