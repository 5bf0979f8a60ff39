"""Checks of the models' parameters, with messages that name model and parameter."""

from __future__ import annotations

import math

from meshtide_codec.errors import OptionError


def check_probability(model: str, parameter: str, value: float) -> None:
    """Raise OptionError unless `value` is in [0, 1].

    >>> check_probability("loss", "rate", 1.5)
    Traceback (most recent call last):
    meshtide_codec.errors.OptionError: loss: rate must be a probability in [0, 1], not 1.5
    """
    if not 0.0 <= value <= 1.0:
        raise OptionError(f"{model}: {parameter} must be a probability in [0, 1], not {value:g}")


def check_at_least(model: str, parameter: str, value: float, least: float) -> None:
    """Raise OptionError unless `value` is finite and not below `least`."""
    if not (value >= least and math.isfinite(value)):
        raise OptionError(f"{model}: {parameter} must be at least {least:g}, not {value:g}")


def check_positive(model: str, parameter: str, value: float) -> None:
    """Raise OptionError unless `value` is finite and more than 0."""
    if not (value > 0 and math.isfinite(value)):
        raise OptionError(f"{model}: {parameter} must be more than 0, not {value:g}")
