"""How much time encoder and decoder spend on a stream: the coders of its layers mix more contexts at effort high."""

from __future__ import annotations

import enum


class Effort(enum.StrEnum):
    """What an encoder is asked to optimise: time, or size."""

    DEFAULT = "default"
    HIGH = "high"
