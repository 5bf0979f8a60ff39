from __future__ import annotations

import pytest

from meshtide_client.connection.link import Link
from meshtide_codec.errors import OptionError


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("timeout", 0.0),
        ("timeout", float("nan")),
        ("retries", -1),
        ("delay", 0.0),
        ("longest_delay", -1.0),
        ("window", 0),
        ("rate", 0.0),
        ("rate", float("nan")),
    ],
)
def test_links_that_make_no_sense_are_refused(name: str, value: float) -> None:
    with pytest.raises(OptionError, match=f"the {name.replace('_', ' ')} of a link"):
        Link(**{name: value})  # type: ignore[arg-type]


def test_a_link_for_other_servers_shows_no_token() -> None:
    link = Link(token="my-own-token", retries=1)  # noqa: S106
    assert link.without_token() == Link(token=None, retries=1)
    assert "my-own-token" not in repr(link)
