"""The textual form of a chain of models, for the command line.

::

    gilbert:p=0.05,r=0.5 + deadline:seconds=2
    drop:kind=diff,level=0/2-4
    none
"""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import OptionError
from meshtide_codec.packets import PacketKind
from meshtide_lab.link.damage import BitErrors, Noise
from meshtide_lab.link.loss import Drop, GilbertElliott, IndependentLoss
from meshtide_lab.link.timing import Bandwidth, Deadline, Delay, Jitter
from meshtide_lab.link.traffic import ALL_KINDS, PROTECTED

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from meshtide_lab.link.traffic import LinkModel

KIND_NAMES = {
    "base": PacketKind.BASE,
    "map-conn": PacketKind.MAP_CONN,
    "param": PacketKind.PARAM,
    "diff": PacketKind.DIFF,
    "preview": PacketKind.PREVIEW,
    "order": PacketKind.ORDER,
}
LARGEST_INDEX = 1 << 20


def parse_models(text: str) -> tuple[LinkModel, ...]:
    """The models that `text` names, first to last; `none`, or nothing, is a perfect link.

    Raises:
        OptionError: an unknown model or parameter, a missing one, or a value out of range.

    >>> parse_models("loss:rate=0.1 + delay:seconds=0.05")
    (IndependentLoss(rate=0.1, unit=0), Delay(seconds=0.05))
    >>> parse_models("los:rate=0.1")
    Traceback (most recent call last):
    meshtide_codec.errors.OptionError: there is no link model 'los'; there are bandwidth, biterrors, deadline, ...
    """
    parts = [part.strip() for part in text.split("+")]
    if parts in ([""], ["none"]):
        return ()
    return tuple(_parse_model(part) for part in parts)


def parse_unprotected(text: str) -> frozenset[PacketKind]:
    """The kinds of packets that stay protected when those of `text` are not: names with commas between, or `all`.

    Raises:
        OptionError: an unknown kind.

    >>> sorted(kind.label for kind in parse_unprotected("map-conn,param"))
    ['Base', 'Order', 'Preview']
    """
    if text.strip() == "all":
        return frozenset()
    named = {_kind(name.strip()) for name in text.split(",") if name.strip()}
    return (PROTECTED if named else ALL_KINDS - {PacketKind.DIFF}) - named


def _parse_model(text: str) -> LinkModel:
    name, _, rest = text.partition(":")
    name = name.strip()
    if name not in _READERS:
        raise OptionError(f"there is no link model {name!r}; there are {', '.join(sorted(_READERS))}")
    values: dict[str, str] = {}
    for part in rest.split(",") if rest.strip() else []:
        parameter, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not parameter or not value:
            raise OptionError(f"{name}: parameters are written like rate=0.1, not {part.strip()!r}")
        if parameter in values:
            raise OptionError(f"{name}: {parameter} is given twice")
        values[parameter] = value
    make, readers = _READERS[name]
    if name == "gilbert" and not values.keys() & {"p", "r"}:
        make, readers = GilbertElliott.with_mean, {"loss": _number, "burst": _number, "unit": _whole}
    arguments: dict[str, Any] = {}
    for parameter, value in values.items():
        if parameter not in readers:
            raise OptionError(f"{name}: there is no parameter {parameter!r}; there are {', '.join(readers)}")
        arguments[_FIELDS.get(parameter, parameter)] = readers[parameter](f"{name}: {parameter}", value)
    for parameter, argument in inspect.signature(make).parameters.items():
        if argument.default is inspect.Parameter.empty and parameter not in arguments:
            hint = " (or loss and burst, in place of p and r)" if name == "gilbert" else ""
            raise OptionError(f"{name}: {parameter} is missing{hint}")
    model: LinkModel = make(**arguments)
    return model


def _number(place: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise OptionError(f"{place} must be a number, not {text!r}") from None


def _whole(place: str, text: str) -> int:
    if not text.isdecimal():
        raise OptionError(f"{place} must be a whole number, not {text!r}")
    return int(text)


def _switch(place: str, text: str) -> bool:
    if text not in {"on", "off"}:
        raise OptionError(f"{place} is on or off, not {text!r}")
    return text == "on"


def _word(_place: str, text: str) -> str:
    return text


def _numbers(place: str, text: str) -> frozenset[int]:
    """Numbers and ranges with slashes between: 0/2-4."""
    found: set[int] = set()
    for part in text.split("/"):
        first, dash, last = part.partition("-")
        bounds = (first, last if dash else first)
        if not all(bound.isdecimal() and int(bound) <= LARGEST_INDEX for bound in bounds):
            raise OptionError(f"{place} is written like 0/2-4, not {text!r}")
        if int(bounds[0]) > int(bounds[1]):
            raise OptionError(f"{place}: the range {part} is empty")
        found.update(range(int(bounds[0]), int(bounds[1]) + 1))
    return frozenset(found)


def _kind(text: str) -> PacketKind:
    if text not in KIND_NAMES:
        raise OptionError(f"there is no kind of packet {text!r}; there are {', '.join(KIND_NAMES)}")
    return KIND_NAMES[text]


def _kind_of(_place: str, text: str) -> PacketKind:
    return _kind(text)


_FIELDS = {"level": "levels", "slice": "slices", "packet": "packets"}
_READERS: Mapping[str, tuple[Callable[..., Any], Mapping[str, Callable[[str, str], Any]]]] = {
    "drop": (Drop, {"kind": _kind_of, "level": _numbers, "slice": _numbers, "packet": _numbers}),
    "loss": (IndependentLoss, {"rate": _number, "unit": _whole}),
    "gilbert": (GilbertElliott, {"p": _number, "r": _number, "good": _number, "bad": _number, "unit": _whole}),
    "bandwidth": (Bandwidth, {"rate": _number}),
    "delay": (Delay, {"seconds": _number}),
    "jitter": (Jitter, {"seconds": _number}),
    "deadline": (Deadline, {"seconds": _number}),
    "noise": (Noise, {"kind": _word, "steps": _number, "relative": _number, "level": _numbers}),
    "biterrors": (BitErrors, {"rate": _number, "checks": _switch}),
}
