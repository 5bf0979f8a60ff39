from __future__ import annotations

import pytest

from meshtide_client.connection.tide_address import parse_address
from meshtide_client.download.transport import transports_for
from meshtide_codec.errors import OptionError


@pytest.mark.parametrize(
    ("url", "choice", "names"),
    [
        ("http://h/meshes/vase", "auto", ["websocket", "http", "download"]),
        ("http://h/meshes/vase", "http", ["http"]),
        ("http://h/vase.tide", "auto", ["http", "download"]),
        ("http://h/vase.tide", "download", ["download"]),
        ("s3://b/vase.tide", "auto", ["s3"]),
        ("vase.tide", "auto", ["local"]),
    ],
)
def test_transports_of_an_address(url: str, choice: str, names: list[str]) -> None:
    assert list(transports_for(parse_address(url), choice)) == names


@pytest.mark.parametrize(("url", "choice"), [("http://h/meshes/v", "pigeon"), ("http://h/v.tide", "websocket")])
def test_impossible_transports_are_refused(url: str, choice: str) -> None:
    with pytest.raises(OptionError, match=choice):
        transports_for(parse_address(url), choice)
