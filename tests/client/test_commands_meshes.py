"""`meshtide meshes` as a person types it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from typer.testing import CliRunner

from meshtide_client.commands.application import build

from .test_remote_listing import MANY, READY, answering, paging

if TYPE_CHECKING:
    from click.testing import Result


def meshtide(*arguments: str) -> Result:
    return CliRunner().invoke(build(), ["meshes", *arguments])


def test_every_filter_reaches_the_server() -> None:
    with paging([], 3) as (url, queries):
        done = meshtide(
            url,
            *("--search", "old vase", "--tag", "clay", "--tag", "scan", "--licence", "CC BY", "--status", "ready"),
            *("--smallest", "1", "--largest", "2", "--fewest-vertices", "3", "--most-vertices", "4"),
            *("--fewest-levels", "5", "--most-levels", "6", "--created-after", "2026-11-01"),
            *("--created-before", "2026-12-01T10:00:00+0100", "--box", "0", "0", "0", "1", "1", "1.5"),
            *("--after", "a", "--limit", "10"),
        )
    assert done.exit_code == 0, done.output
    assert "the server hosts no such meshes" in done.output
    assert "&".join(queries) == (
        "q=old+vase&tag=clay&tag=scan&licence=CC+BY&status=ready&smallest=1&largest=2&fewest_vertices=3&most_vertices=4"
        "&fewest_levels=5&most_levels=6&created_after=2026-11-01T00%3A00%3A00"
        "&created_before=2026-12-01T10%3A00%3A00%2B01%3A00&box=0.0%2C0.0%2C0.0%2C1.0%2C1.0%2C1.5&after=a&limit=10"
    )


def test_all_pages_as_json() -> None:
    with paging([row | {"tags": ["clay"]} for row in MANY], 3) as (url, _):
        done = meshtide(url, "--json")
        answer = json.loads(done.stdout)
        assert answer["server"] == url
    assert [mesh["id"] for mesh in answer["meshes"]] == [row["id"] for row in MANY]
    assert answer["meshes"][0]["tags"] == ["clay"]


def test_a_table_for_people() -> None:
    with answering(json.dumps([READY]).encode()) as url:
        assert "vase" in meshtide(url).output
    with answering(b"[]") as url:
        assert "the server hosts no meshes" in meshtide(url).output


def test_other_states_are_refused() -> None:
    done = meshtide("http://127.0.0.1:9", "--status", "odd")
    assert done.exit_code == 2
