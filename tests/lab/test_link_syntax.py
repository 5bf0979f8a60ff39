"""The textual form of link models: what it means, and what it refuses."""

from __future__ import annotations

import pytest

from meshtide_codec.errors import OptionError
from meshtide_codec.packets import PacketKind
from meshtide_lab.link.damage import BitErrors, Noise
from meshtide_lab.link.loss import Drop, GilbertElliott
from meshtide_lab.link.syntax import parse_models, parse_unprotected
from meshtide_lab.link.timing import Bandwidth, Deadline, Delay, Jitter
from meshtide_lab.link.traffic import PROTECTED


def test_models_in_their_order() -> None:
    text = " bandwidth:rate=2e4+delay:seconds=.05 + jitter:seconds=0.01 + deadline: seconds = 2 "
    assert parse_models(text) == (Bandwidth(2e4), Delay(0.05), Jitter(0.01), Deadline(2.0))
    assert parse_models("gilbert:p=0.05,r=0.5,bad=0.9,unit=1200") == (GilbertElliott(0.05, 0.5, bad=0.9, unit=1200),)
    assert parse_models("gilbert:loss=0.1,burst=4") == (GilbertElliott.with_mean(0.1, 4),)
    assert parse_models("noise:kind=laplace,relative=1,level=0/2-3") == (
        Noise("laplace", relative=1.0, levels=frozenset({0, 2, 3})),
    )
    assert parse_models("biterrors:rate=1e-5,checks=off") == (BitErrors(1e-5, checks=False),)
    assert parse_models("drop:kind=map-conn,level=1,slice=2,packet=7") == (
        Drop(PacketKind.MAP_CONN, frozenset({1}), frozenset({2}), frozenset({7})),
    )
    assert parse_models("drop") == (Drop(),)
    assert parse_models("none") == parse_models("") == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("los:rate=0.1", "no link model 'los'"),
        ("loss:rate=0.1 + ", "no link model ''"),
        ("none + loss:rate=0.1", "no link model 'none'"),
        ("loss", "rate is missing"),
        ("gilbert:p=0.1", "r is missing (or loss and burst"),
        ("gilbert:loss=0.1", "burst is missing"),
        ("gilbert:p=0.1,loss=0.1", "no parameter 'loss'"),
        ("loss:rate", "written like"),
        ("loss:rate=", "written like"),
        ("loss:rate=0.1,rate=0.2", "given twice"),
        ("loss:rate=often", "must be a number"),
        ("loss:rate=nan", "probability"),
        ("loss:rate=1.5", "probability in [0, 1], not 1.5"),
        ("loss:rate=0.1,unit=1.5", "whole number"),
        ("delay:seconds=-1", "at least 0"),
        ("delay:seconds=inf", "at least 0"),
        ("bandwidth:rate=0", "more than 0"),
        ("noise:relative=1,steps=1", "either in steps or relative"),
        ("noise:kind=gaussian", "either in steps or relative"),
        ("noise:kind=pink,steps=1", "not one of gaussian"),
        ("noise:steps=-1", "at least 0"),
        ("biterrors:rate=0.1,checks=maybe", "on or off"),
        ("drop:kind=diffs", "no kind of packet 'diffs'"),
        ("drop:level=3-1", "empty"),
        ("drop:level=one", "written like"),
        ("drop:packet=0-99999999999", "written like"),
    ],
)
def test_what_is_refused(text: str, message: str) -> None:
    with pytest.raises(OptionError) as refusal:
        parse_models(text)
    assert message in str(refusal.value)


def test_protection() -> None:
    assert parse_unprotected("") == PROTECTED
    assert parse_unprotected("all") == frozenset()
    assert parse_unprotected("map-conn, param") == PROTECTED - {PacketKind.MAP_CONN, PacketKind.PARAM}
    with pytest.raises(OptionError, match="no kind of packet"):
        parse_unprotected("map")
