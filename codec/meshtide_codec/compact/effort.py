"""How much time encoder and decoder spend on a stream: effort, and which layers are coded deeply for it.

At effort high, the coders of some layers mix more, and more slowly (`entropy.deep_mixing_kernels`). The header tells
for each layer whether it is coded deeply, so a later encoder may choose differently.
"""

from __future__ import annotations

import enum


class Effort(enum.StrEnum):
    """What an encoder is asked to optimise: time, or size."""

    DEFAULT = "default"
    HIGH = "high"

    @property
    def deep_layers(self) -> DeepLayers:
        """The layers that are coded deeply at this effort."""
        return DeepLayers.ALL if self is Effort.HIGH else DeepLayers.NONE


class DeepLayers(enum.IntFlag, boundary=enum.STRICT):
    """Layers that are coded deeply; the bits that the stream header's option `e` is made of."""

    NONE = 0
    DIFFS = 1
    MAPS = 2
    FACES = 4
    ALL = DIFFS | MAPS | FACES
