"""Noise and bit errors: sizes, distributions, what checksums make of damage."""

from __future__ import annotations

import math

import numpy as np
import pytest

from meshtide_codec.packets import PacketKind
from meshtide_codec.stream.header import PacketEntry
from meshtide_lab.link.damage import DISTRIBUTIONS, BitErrors, Noise, flipped
from meshtide_lab.link.traffic import DAMAGE, Fate


def fates(count: int, length: int = 1000, kind: PacketKind = PacketKind.DIFF) -> list[Fate]:
    return [Fate(PacketEntry(kind, index % 4, 0, length, 0), index, False) for index in range(count)]


@pytest.mark.parametrize("kind", DISTRIBUTIONS)
def test_noise_has_its_mean_size_and_shape(kind: str) -> None:
    packet = fates(1)
    Noise(kind, steps=2.0).apply(packet, 1, "noise")  # type: ignore[arg-type]
    noise = packet[0].noises[0](np.zeros((100_000, 3)))
    assert noise.mean() == pytest.approx(0.0, abs=0.02)
    assert noise.std() == pytest.approx(2.0, rel=0.01)
    kurtosis = {"gaussian": 3.0, "uniform": 1.8, "laplace": 6.0}[kind]
    assert (noise**4).mean() / 2.0**4 == pytest.approx(kurtosis, rel=0.05)


def test_relative_noise_is_as_large_as_the_diffs() -> None:
    differences = np.random.default_rng(0).normal(size=(50_000, 3)) * 7
    packet = fates(1)
    Noise(relative=0.5).apply(packet, 1, "noise")
    added = packet[0].noises[0](differences) - differences
    assert math.sqrt((added**2).mean()) == pytest.approx(3.5, rel=0.02)
    np.testing.assert_array_equal(packet[0].noises[0](differences) - differences, added)
    assert packet[0].noises[0](np.zeros((0, 3))).shape == (0, 3)


def test_noise_is_for_diffs_of_chosen_levels() -> None:
    packets = [*fates(4), *fates(1, kind=PacketKind.PARAM)]
    Noise(steps=1.0, levels=frozenset({1, 2})).apply(packets, 1, "noise")
    assert [len(fate.noises) for fate in packets] == [0, 1, 1, 0, 0]


def test_bits_are_flipped_at_their_rate() -> None:
    packets = fates(200)
    BitErrors(0.001, checks=False).apply(packets, 2, "biterrors")
    counts = np.array([len(fate.flipped_bits) for fate in packets])
    assert abs(counts.mean() - 8.0) < 3.29 * math.sqrt(8.0 / len(counts))
    assert all(0 <= bit < 8000 for fate in packets for bit in fate.flipped_bits)
    assert all(list(fate.flipped_bits) == sorted(set(fate.flipped_bits)) for fate in packets)


def test_checksums_turn_damage_into_loss() -> None:
    packets = fates(50)
    BitErrors(1e-4).apply(packets, 2, "biterrors")
    damaged = fates(50)
    BitErrors(1e-4, checks=False).apply(damaged, 2, "biterrors")
    assert [fate.cause == DAMAGE for fate in packets] == [bool(fate.flipped_bits) for fate in damaged]
    assert 5 < sum(fate.lost for fate in packets) < 45
    assert not any(fate.lost for fate in damaged)


def test_the_ends_of_the_scale() -> None:
    packets = fates(1, length=2)
    BitErrors(0.0, checks=False).apply(packets, 2, "a")
    assert packets[0].flipped_bits == ()
    BitErrors(1.0, checks=False).apply(packets, 2, "b")
    assert packets[0].flipped_bits == tuple(range(16))
    BitErrors(1.0, checks=False).apply(packets, 2, "c")
    assert packets[0].flipped_bits == ()


def test_flipping_twice_restores() -> None:
    assert flipped(flipped(b"meshtide", (3, 9, 63)), (3, 9, 63)) == b"meshtide"
