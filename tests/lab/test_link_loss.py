"""Losses: measured rates and bursts against the theory, datagrams, chosen packets."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshtide_codec.errors import OptionError
from meshtide_codec.packets import PacketKind
from meshtide_codec.stream.header import PacketEntry
from meshtide_lab.link.loss import Drop, GilbertElliott, IndependentLoss
from meshtide_lab.link.traffic import Fate, LinkModel

if TYPE_CHECKING:
    from numpy.typing import NDArray

NORMAL_999 = 3.29  # of a thousand tests one is outside by chance; seeds are fixed, so these are not


def fates(count: int, *, length: int = 100, kind: PacketKind = PacketKind.DIFF, protected: bool = False) -> list[Fate]:
    return [Fate(PacketEntry(kind, index % 7, index % 3, length, 0), index, protected) for index in range(count)]


def lost(model: LinkModel, packets: list[Fate], seed: int = 5) -> np.ndarray:
    model.apply(packets, seed, model.name)
    return np.array([fate.lost for fate in packets])


def loss_runs(lost: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Lengths of the runs of losses."""
    edges = np.flatnonzero(np.diff(np.r_[False, lost, False].astype(np.int8)))
    return edges[1::2] - edges[::2]


def mean_burst(model: GilbertElliott) -> float:
    """Mean number of packets lost in a row: P(lost) / P(lost, and the one before was not); NaN if none is lost.

    With nothing lost in the good state and everything in the bad one it is 1 / r.
    """
    bad = model.bad_share
    twice = bad * model.bad * ((1 - model.r) * model.bad + model.r * model.good)
    twice += (1 - bad) * model.good * (model.p * model.bad + (1 - model.p) * model.good)
    if model.mean_loss == 0.0:
        return float("nan")
    begins = model.mean_loss - twice
    return model.mean_loss / begins if begins > 0.0 else float("inf")


@pytest.mark.parametrize(
    "model",
    [
        GilbertElliott(p=0.05, r=0.5),
        GilbertElliott.with_mean(0.01, burst=10),
        GilbertElliott.with_mean(0.2, burst=10),
        GilbertElliott.with_mean(0.2, burst=1),
        GilbertElliott(p=0.1, r=0.3, good=0.02, bad=0.7),
        GilbertElliott(p=1.0, r=0.5, good=0.3, bad=0.9),
    ],
)
def test_measured_rate_and_bursts_agree_with_the_theory(model: GilbertElliott) -> None:
    blocks = [lost(model, fates(200), seed) for seed in range(300)]
    rates = np.array([block.mean() for block in blocks])
    margin = NORMAL_999 * rates.std(ddof=1) / math.sqrt(len(rates))
    assert abs(rates.mean() - model.mean_loss) < margin

    long = model.losses(np.random.Generator(np.random.PCG64(1)).random((200_000, 2)))
    runs = loss_runs(long)
    margin = NORMAL_999 * runs.std(ddof=1) / math.sqrt(len(runs)) if runs.std() else 1e-12
    assert abs(runs.mean() - mean_burst(model)) <= margin


def test_known_means() -> None:
    model = GilbertElliott(p=0.05, r=0.5)
    assert model.mean_loss == pytest.approx(0.05 / 0.55)
    assert mean_burst(model) == pytest.approx(2.0)
    same = GilbertElliott(p=0.3, r=0.3, good=0.2, bad=0.2)  # both states alike: independent losses
    assert same.mean_loss == pytest.approx(0.2)
    assert mean_burst(same) == pytest.approx(1 / 0.8)
    assert math.isnan(mean_burst(GilbertElliott(p=0.5, r=0.5, bad=0.0)))
    assert mean_burst(GilbertElliott(p=1.0, r=0.0)) == math.inf


def test_independent_losses() -> None:
    found = np.concatenate([lost(IndependentLoss(0.1), fates(100), seed) for seed in range(200)])
    assert abs(found.mean() - 0.1) < NORMAL_999 * math.sqrt(0.09 / len(found))


def test_a_large_packet_is_lost_more_often_where_datagrams_are() -> None:
    found = np.concatenate([lost(IndependentLoss(0.1, unit=50), fates(100, length=101), seed) for seed in range(100)])
    share = 1 - 0.9**3
    assert abs(found.mean() - share) < NORMAL_999 * math.sqrt(share * (1 - share) / len(found))
    assert not lost(IndependentLoss(0.0, unit=1), fates(50)).any()
    assert lost(GilbertElliott(p=1.0, r=0.0, unit=1), fates(50)).all()


def test_a_packets_numbers_do_not_depend_on_others() -> None:
    whole = lost(IndependentLoss(0.5), fates(60))
    part = lost(IndependentLoss(0.5), fates(60)[30:])
    np.testing.assert_array_equal(whole[30:], part)


def test_more_loss_loses_the_same_packets_and_more() -> None:
    little, much = (lost(IndependentLoss(rate), fates(200)) for rate in (0.1, 0.3))
    assert (much | ~little).all()
    assert much.sum() > little.sum()


def test_protected_packets_are_not_lost_but_count_for_the_chain() -> None:
    model = GilbertElliott.with_mean(0.3, burst=5)
    mixed = fates(100)
    for fate in mixed[::2]:
        fate.protected = True
    found = lost(model, mixed)
    assert not found[::2].any()
    np.testing.assert_array_equal(found[1::2], lost(model, fates(100))[1::2])


def test_chosen_packets() -> None:
    assert lost(Drop(levels=frozenset({2}), slices=frozenset({0})), fates(42)).nonzero()[0].tolist() == [9, 30]
    assert lost(Drop(packets=frozenset({3, 50})), fates(42)).nonzero()[0].tolist() == [3]
    assert not lost(Drop(PacketKind.PARAM), fates(5)).any()
    with pytest.raises(OptionError, match="Map&Conn packets, which are protected"):
        lost(Drop(PacketKind.MAP_CONN), fates(5, kind=PacketKind.MAP_CONN, protected=True))


@pytest.mark.parametrize("value", [-0.1, 1.1, math.nan])
def test_probabilities_outside_of_0_to_1_are_refused(value: float) -> None:
    with pytest.raises(OptionError, match="probability"):
        IndependentLoss(value)
    for name in ("p", "r", "good", "bad"):
        with pytest.raises(OptionError, match=f"gilbert: {name}"):
            GilbertElliott(**{"p": 0.5, "r": 0.5, name: value})
    with pytest.raises(OptionError, match="probability"):
        GilbertElliott.with_mean(value, burst=2)


def test_chains_that_there_are_not_are_refused() -> None:
    with pytest.raises(OptionError, match="never moves"):
        GilbertElliott(p=0.0, r=0.0)
    with pytest.raises(OptionError, match="longer than 1"):
        GilbertElliott.with_mean(0.6, burst=1)
    with pytest.raises(OptionError, match="at least 1"):
        GilbertElliott.with_mean(0.1, burst=0.5)
    with pytest.raises(OptionError, match="unit"):
        IndependentLoss(0.1, unit=-1)
