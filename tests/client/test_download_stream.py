from __future__ import annotations

import asyncio
from contextlib import aclosing
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from meshtide_client.connection.link import Link
from meshtide_client.download.download import Download
from meshtide_client.download.holding import Holding
from meshtide_client.download.levels import LevelFigures
from meshtide_client.download.stream import stream
from meshtide_codec.decoder import decode
from meshtide_codec.errors import LimitError, OptionError, StreamError, TransferError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.container import preamble
from meshtide_codec.stream.messages import Done, decode_message, encode_message
from meshtide_codec.stream.session import Until
from server_end import ServerEnd
from streams import MadeUpStream, Served

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from websockets.asyncio.server import ServerConnection

MESH = "vase"


@pytest.fixture(scope="module", name="source")
def _source() -> Served:
    return Served()


async def test_all_levels_come_coarse_to_fine(serving: Callable[..., Any], source: Served) -> None:
    async with serving(source) as server:
        levels = [level async for level in stream(server.url)]
    assert [level.level for level in levels] == [row.level for row in source.header.levels]
    assert len(levels) > 2
    for level, row in zip(levels, source.header.levels, strict=True):
        assert (level.vertices, level.faces, level.rms, level.maximum) == (
            row.vertices,
            row.faces,
            row.rms,
            row.maximum,
        )
        assert level.exact
        expected = decode(source.whole, level.level)
        np.testing.assert_array_equal(level.mesh.vertices, expected.vertices)
        np.testing.assert_array_equal(level.mesh.faces, expected.faces)
    assert levels[-1].size == len(source.whole)
    assert [level.seconds for level in levels] == sorted(level.seconds for level in levels)
    assert [level.size for level in levels] == sorted(level.size for level in levels)


async def test_the_size_of_a_level_is_that_of_the_file_that_holds_it(
    serving: Callable[..., Any], source: Served
) -> None:
    async with serving(source) as server:
        async for level in stream(server.url):
            decode_partial = source.whole[: level.size]
            row = source.header.entry(level.level)
            assert len(decode_partial) == len(preamble(source.header_bytes)) + source.header.level_bytes(row)


@pytest.mark.parametrize("until", [Until(level=10**6), Until(error=float("inf")), Until(size=10**30)])
async def test_bounds_that_no_message_can_hold_mean_the_most(
    serving: Callable[..., Any], source: Served, until: Until
) -> None:
    async with serving(source) as server:
        levels = [level.level async for level in stream(server.url, until=until)]
    assert levels == [row.level for row in source.header.levels][: 1 if until.size is None else None]


async def test_figures_can_be_kept_without_the_mesh(serving: Callable[..., Any], source: Served) -> None:
    async with serving(source) as server:
        levels = [level async for level in stream(server.url, until=Until(level=99))]
    assert type(levels[0].figures) is LevelFigures
    assert levels[0].figures.vertices == levels[0].vertices


async def test_a_level_that_is_not_there_is_told_whatever_the_header_says(
    serving: Callable[..., Any], source: Served
) -> None:
    """A header may claim anything of a level; whoever decodes it knows."""
    lying = Served()
    *coarser, finest = source.header.levels
    early = replace(finest, packet_count=coarser[-1].packet_count)
    lying.header = replace(source.header, levels=(*coarser, early))
    lying.header_bytes = lying.header.to_bytes()
    async with serving(lying) as server:
        with pytest.raises(StreamError, match=f"level 0 is not complete after {early.packet_count} packets"):
            [level async for level in stream(server.url)]


@pytest.mark.parametrize("false", [0, 1, slice(0, -1)])
async def test_no_claim_to_be_the_finest_mesh_puts_later_levels_aside(
    serving: Callable[..., Any], source: Served, false: int | slice
) -> None:
    lying = Served()
    levels = np.array(source.header.levels, object)
    lied = {row.level for row in np.atleast_1d(levels[false])}
    rows = tuple(replace(row, rms=0.0, maximum=0.0) if row.level in lied else row for row in levels)
    lying.header = replace(source.header, levels=rows)
    lying.header_bytes = lying.header.to_bytes()
    async with serving(lying) as server:
        shown = [level async for level in stream(server.url)]
        assert server.finished_packets == list(range(len(source.header.packets)))
    assert [level.level for level in shown] == [row.level for row in source.header.levels]
    expected = decode(source.whole)
    np.testing.assert_array_equal(shown[-1].mesh.vertices, expected.vertices)


@pytest.mark.parametrize("claims", ["nearest first", "all far"])
async def test_level_0_comes_last_whatever_the_distances(
    serving: Callable[..., Any], source: Served, claims: str
) -> None:
    lying = Served()
    rms = 1e-6 if claims == "nearest first" else 1.5
    *coarse, finest = source.header.levels
    rows = (*[replace(row, rms=rms, maximum=rms) for row in coarse], replace(finest, rms=1.75, maximum=1.75))
    lying.header = replace(source.header, levels=rows)
    lying.header_bytes = lying.header.to_bytes()
    async with serving(lying) as server:
        shown = [level async for level in stream(server.url)]
        assert server.finished_packets == list(range(len(source.header.packets)))
    assert (shown[-1].level, shown[-1].exact) == (0, True)
    np.testing.assert_array_equal(shown[-1].mesh.vertices, decode(source.whole).vertices)


@pytest.mark.parametrize("more", [True, False])
async def test_whether_the_stream_goes_on_is_not_believed(
    more: bool, listening: Callable[..., Any], source: Served
) -> None:
    for level, rest in ((0, False), (1, True)):

        async def handle(socket: ServerConnection) -> None:
            session = ServerEnd(MESH, source)
            session.receive(await socket.recv())
            while (frame := session.next_frame()) is not None:
                if isinstance(decode_message(frame), Done):
                    frame = encode_message(Done(0, 0, more))
                await socket.send(frame)

        async with listening(handle) as address:
            download = Download(address, Holding(), until=Until(level=level))
            figures = [found async for found in download.levels()]
            assert (figures[-1].level, figures[-1].exact, download.more) == (level, True, rest)


async def test_leaving_early_closes_the_socket(serving: Callable[..., Any], source: Served) -> None:
    async with serving(source) as server:
        async with aclosing(stream(server.url, link=Link(window=64))) as levels:
            async for _ in levels:
                break
        await asyncio.sleep(0.05)
        assert server.closed == 1
        assert len(server.finished_packets) < len(source.header.packets)


@pytest.mark.parametrize("until", [Until(level=1), Until(error=0.1), Until(size=700)])
async def test_bounds_are_kept(serving: Callable[..., Any], source: Served, until: Until) -> None:
    wanted = until.packet_count(source.header, len(source.header_bytes))
    async with serving(source) as server:
        levels = [level async for level in stream(server.url, until=until)]
    assert [level.level for level in levels] == [
        row.level for row in source.header.levels if row.packet_count <= wanted
    ]
    assert 0 < len(levels) < len(source.header.levels)


async def test_a_file_holds_what_came_and_gives_it_back(
    serving: Callable[..., Any], source: Served, tmp_path: Path
) -> None:
    path = tmp_path / "vase.tide"
    async with serving(source) as server:
        first = [level.level async for level in stream(server.url, until=Until(level=1), resume=path)]
        sent = len(server.finished_packets)
        second = [level.level async for level in stream(server.url, resume=str(path))]
    assert second == [row.level for row in source.header.levels]
    assert first == second[:-1]
    assert server.finished_packets == list(range(len(source.header.packets)))
    assert 0 < sent < len(source.header.packets)
    assert path.read_bytes() == source.whole


async def test_a_file_that_holds_more_than_is_wanted(
    serving: Callable[..., Any], source: Served, tmp_path: Path
) -> None:
    path = tmp_path / "vase.tide"
    path.write_bytes(source.whole)
    async with serving(source) as server:
        levels = [level.level async for level in stream(server.url, until=Until(level=1), resume=path)]
    assert levels[-1] == 1
    assert server.finished_packets == []
    assert path.read_bytes() == source.whole


async def test_levels_go_on_after_a_lost_connection(serving: Callable[..., Any], source: Served) -> None:
    sentences: list[str] = []
    async with serving(source, cuts=[4]) as server:
        link = Link(delay=0.001)
        levels = [level.level async for level in stream(server.url, link=link, notify=sentences.append)]
    assert levels == [row.level for row in source.header.levels]
    assert server.connections == 2
    assert len(sentences) == 1


async def test_levels_that_came_are_there_when_the_network_fails(serving: Callable[..., Any], source: Served) -> None:
    levels: list[int] = []
    async with serving(source, cuts=[4, 1]) as server:
        with pytest.raises(TransferError, match="was lost"):
            async for level in stream(server.url, link=Link(retries=1, delay=0.001)):
                levels.append(level.level)  # noqa: PERF401 - what came before the error counts
    assert levels == [source.header.levels[0].level]


async def test_a_stream_that_changes_starts_from_the_coarsest_level(
    serving: Callable[..., Any], source: Served, tmp_path: Path
) -> None:
    path = tmp_path / "vase.tide"
    path.write_bytes(Served(12).whole)
    sentences: list[str] = []
    async with serving(source) as server:
        levels = [level.level async for level in stream(server.url, resume=path, notify=sentences.append)]
    assert levels == [row.level for row in source.header.levels]
    assert any("has changed" in sentence for sentence in sentences)


async def test_limits_are_kept(serving: Callable[..., Any], source: Served) -> None:
    async with serving(source) as server:
        with pytest.raises(LimitError, match=r"Limits\.vertices"):
            async for _ in stream(server.url, limits=Limits(vertices=10)):
                pass


async def test_a_stream_that_cannot_be_decoded_raises(serving: Callable[..., Any]) -> None:
    async with serving(MadeUpStream()) as server:
        with pytest.raises(StreamError):
            async for _ in stream(server.url):
                pass


async def test_a_bad_address_is_refused() -> None:
    with pytest.raises(OptionError, match="write it like"):
        await anext(stream("vase"))
