"""What a query of meshes may say, and how it stands in an address."""

from dataclasses import fields
from datetime import UTC, datetime

import pytest

from meshtide_codec.stream.mesh_query import ASKED, MeshQuery, parse_box


def test_every_field_says_what_it_means_and_no_two_share_a_name() -> None:
    assert list(ASKED) == [each.name for each in fields(MeshQuery)]
    assert all(asked.meaning.endswith(".") for asked in ASKED.values())
    assert len({asked.name or name for name, asked in ASKED.items()}) == len(ASKED)


def test_what_is_left_out_is_not_sent_and_nothing_is_something() -> None:
    assert MeshQuery().parameters() == []
    assert MeshQuery(smallest=0, largest=0).parameters() == [("smallest", "0"), ("largest", "0")]


def test_boxes_and_moments_as_they_stand_in_an_address() -> None:
    query = MeshQuery(box=(0.1, -1, 0, 1e300, 2, 3), created_after=datetime(2026, 11, 2, 9, tzinfo=UTC))
    assert query.parameters() == [
        ("created_after", "2026-11-02T09:00:00+00:00"),
        ("box", "0.1,-1.0,0.0,1e+300,2.0,3.0"),
    ]
    assert parse_box(dict(query.parameters())["box"]) == query.box


@pytest.mark.parametrize("text", ["", "1", "1,2,3,4,5", "1,2,3,4,5,6,7", "a,b,c,d,e,f", "inf,0,0,1,1,1", "0," * 200])
def test_foreign_boxes_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"six numbers|convert"):
        parse_box(text)
