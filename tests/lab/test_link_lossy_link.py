"""A link and the receiver behind it: both profiles, order of arrival, unprotected losses, damage, noise."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_client.download.packet_filter import find_filter
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.errors import OptionError
from meshtide_codec.packets import PacketKind
from meshtide_codec.samples import load_sample
from meshtide_codec.testing import grid
from meshtide_lab.link.fidelity import StreamMeter
from meshtide_lab.link.lossy_link import UNDECODABLE, LossyLink, LossyReceiver, lossy_filter, receive

STREAMS = {
    "classic": ClassicOptions(bits=10, coarsest_vertices=40),
    "compact": CompactOptions(bits=10, previews=()),
    "sliced": CompactOptions(bits=10, previews=(20,), slices=6),
}


@functools.cache
def stream(name: str) -> EncodedMesh:
    return encode(grid(26), STREAMS[name])


@functools.cache
def meter(name: str) -> StreamMeter:
    return StreamMeter(stream(name).header, stream(name).packets, samples=300)


@pytest.mark.parametrize("name", STREAMS)
def test_a_perfect_link_changes_nothing(name: str) -> None:
    received = receive(LossyLink(()), stream(name).header, stream(name).packets)
    assert received.report.lost == 0
    assert received.report.received_bytes == sum(len(data) for data in stream(name).packet_bytes)
    np.testing.assert_array_equal(received.decoder.mesh(0).vertices, meter(name).true[0].vertices)
    assert received.decoder.is_exact(0)


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(sorted(STREAMS)),
    st.sampled_from(
        [
            "loss:rate=0.3",
            "gilbert:loss=0.2,burst=5 + noise:relative=1",
            "bandwidth:rate=3000 + jitter:seconds=1 + deadline:seconds=1",
            "biterrors:rate=1e-3,checks=off",
            "noise:kind=uniform,steps=3",
        ]
    ),
    st.sampled_from(["", "all", "map-conn", "param,preview"]),
    st.integers(0, 1000),
)
def test_any_link_is_survived_and_repeated(name: str, text: str, unprotected: str, seed: int) -> None:
    link = LossyLink.parse(text, seed, unprotected)
    first, second = (receive(link, stream(name).header, stream(name).packets) for _ in range(2))
    found = meter(name).measure(first.decoder)
    assert len(found.levels) + len(found.levels_missing) == len(meter(name).levels)
    assert first.report == second.report
    assert first.report.sent == first.report.received + first.report.lost
    for row in found.levels:
        np.testing.assert_array_equal(first.decoder.mesh(row.level).vertices, second.decoder.mesh(row.level).vertices)
    if not unprotected:
        assert set(first.report.lost_kinds) <= {"Diff"}
        assert found.levels_missing == ()


def test_without_protection_nothing_finer_decodes() -> None:
    encoded = stream("classic")
    link = LossyLink.parse("drop:kind=map-conn,level=1", unprotected="map-conn")
    received = receive(link, encoded.header, encoded.packets)
    found = meter("classic").measure(received.decoder)
    assert found.levels_missing == (1, 0)
    assert found.final is not None
    assert found.final.level == 2
    assert "1 Map&Conn" in received.report.summary()


def test_without_the_base_there_is_nothing() -> None:
    encoded = stream("classic")
    received = receive(LossyLink.parse("drop:kind=base", unprotected="base"), encoded.header, encoded.packets)
    found = meter("classic").measure(received.decoder)
    assert found.final is None
    assert len(found.levels_missing) == len(encoded.header.levels)


def test_protected_packets_cannot_be_named() -> None:
    with pytest.raises(OptionError, match="--unprotected"):
        LossyLink.parse("drop:kind=param").plan(stream("classic").header)


def test_a_lost_slice_costs_that_slice_only() -> None:
    encoded = stream("sliced")
    received = receive(LossyLink.parse("drop:kind=diff,slice=2"), encoded.header, encoded.packets)
    moved = (received.decoder.mesh(0).vertices != meter("sliced").true[0].vertices).any(axis=1)
    places = np.flatnonzero(moved)
    assert 0 < len(places) <= places[-1] - places[0] + 1 <= len(moved) / 6 + 1


def test_packets_reach_the_decoder_in_the_order_of_the_links_clock() -> None:
    encoded = stream("sliced")
    link = LossyLink.parse("jitter:seconds=5", seed=4)
    receiver = LossyReceiver(link, encoded.header)
    order: list[int] = []
    push = receiver.decoder.push
    table = {(row.kind, row.level, row.slice): index for index, row in enumerate(encoded.header.packets)}

    def noted(packet: object) -> object:
        order.append(table[packet.kind, packet.level, packet.slice])  # type: ignore[attr-defined]
        return push(packet)  # type: ignore[arg-type]

    receiver.decoder.push = noted  # type: ignore[assignment,method-assign]
    for packet in encoded.packets:
        receiver.take(packet)
    assert order == sorted(range(len(encoded.packets)), key=lambda index: receiver.fates[index].seconds)
    assert order != sorted(order)
    assert receiver.decoder.is_exact(0)
    assert receiver.is_settled(len(encoded.packets))
    assert receiver.report.seconds == max(fate.seconds for fate in receiver.fates)


def test_damage_without_checksums_is_told() -> None:
    encoded = encode(load_sample("spot"), CompactOptions(slices=8))
    meter_of_spot = StreamMeter(encoded.header, encoded.packets, samples=100)
    received = receive(LossyLink.parse("biterrors:rate=3e-4,checks=off", seed=1), encoded.header, encoded.packets)
    assert received.report.damaged > 0
    assert received.report.lost == received.report.causes[UNDECODABLE]
    assert "decoded in spite of bit errors" in received.report.summary()
    final = meter_of_spot.measure(received.decoder).final
    assert final is not None
    assert not final.exact
    assert final.vertex.l_infinity > 0


@pytest.mark.parametrize("name", STREAMS)
def test_noise_is_no_loss_but_nothing_is_exact(name: str) -> None:
    received = receive(LossyLink.parse("noise:relative=1", seed=2), stream(name).header, stream(name).packets)
    diffs = sum(row.kind is PacketKind.DIFF for row in stream(name).header.packets)
    assert (received.report.lost, received.report.perturbed) == (0, diffs)
    assert not received.decoder.is_exact(0)
    found = meter(name).measure(received.decoder)
    assert found.final is not None
    assert found.final.vertex.rms > 0


def test_downloads_find_lossy_links_by_their_entry_point() -> None:
    assert find_filter() is lossy_filter
    assert lossy_filter("loss:rate=0.1", 3, "all") == LossyLink.parse("loss:rate=0.1", 3, "all")
