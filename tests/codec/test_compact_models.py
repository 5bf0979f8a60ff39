"""Trained states: they fit the coders, are handed out as copies, and help small meshes; the format's golden bytes."""

from __future__ import annotations

import zlib
from types import ModuleType

import numpy as np
import pytest

from meshtide_codec.compact import diff_deep_context_kernels, diff_kernels, map_deep_layout, map_layout
from meshtide_codec.compact.diff_coder import new_slice_state
from meshtide_codec.compact.mirror import Mirror
from meshtide_codec.compact.models import (
    DeepModels,
    Models,
    new_deep_map_models,
    new_map_models,
    trained_deep_diff_models,
    trained_diff_models,
    untrained_deep_diff_models,
    untrained_deep_map_models,
    untrained_diff_models,
    untrained_map_models,
)
from meshtide_codec.compact.octree import Octree
from meshtide_codec.compact.slices import Slices
from meshtide_codec.entropy import deep_mixing_kernels
from meshtide_codec.entropy.mixing_kernels import INPUTS, WEIGHT_LIMIT
from octrees import lattice_soup, torus
from payloads import encode_diff, encode_map


def payloads(octree: Octree, map_models: Models, diff_models: Models, mirror: Mirror | None = None) -> list[bytes]:
    slices = Slices(octree.bits)
    state = new_slice_state(octree.levels[0], slices, 0, diff_models)
    packets = []
    for depth in range(1, octree.bits + 1):
        coarse, fine = octree.levels[depth - 1], octree.levels[depth]
        if not coarse.all_leaves:
            packets.append(encode_map(coarse, fine, octree.bits, map_models, mirror))
        packets.append(encode_diff(octree, depth, state, slices, 0, mirror))
    return packets


def size(packets: list[bytes]) -> int:
    return sum(map(len, packets))


@pytest.mark.parametrize(
    ("models", "contexts", "neurons"),
    [
        (new_map_models(), map_layout.CONTEXTS, map_layout.NEURONS),
        (trained_diff_models(), diff_kernels.CONTEXTS, diff_kernels.NEURONS),
        (untrained_map_models(), map_layout.CONTEXTS, map_layout.NEURONS),
        (untrained_diff_models(), diff_kernels.CONTEXTS, diff_kernels.NEURONS),
    ],
)
def test_states_fit_the_coders(models: Models, contexts: int, neurons: int) -> None:
    assert models.contexts.dtype == models.weights.dtype == np.int32
    assert models.contexts.shape == (contexts,)
    assert models.weights.shape == (neurons * INPUTS,)
    assert (np.abs(models.weights) <= WEIGHT_LIMIT).all()
    assert ((models.contexts & 255) <= min(map_layout.LIMIT, diff_kernels.LIMIT)).all()
    assert (models.contexts >= 0).all()
    assert ((models.contexts >> 8) < 65536).all()


@pytest.mark.parametrize(
    ("models", "layout"),
    [
        (new_deep_map_models(), map_deep_layout),
        (trained_deep_diff_models(), diff_deep_context_kernels),
        (untrained_deep_map_models(), map_deep_layout),
        (untrained_deep_diff_models(), diff_deep_context_kernels),
    ],
)
def test_deep_states_fit_the_coders(models: DeepModels, layout: ModuleType) -> None:
    assert {array.dtype for array in models.mixer} == {np.dtype(np.int32)}
    assert models.contexts.shape == (2 * layout.CONTEXTS,)
    assert models.weights.shape == (layout.NEURONS * layout.INPUTS,)
    assert models.final_weights.shape == (layout.FINALS * layout.CHOICES,)
    assert models.corrections.shape == (layout.CORRECTIONS * deep_mixing_kernels.CORRECTION_STEPS,)
    assert (np.abs(models.weights) <= deep_mixing_kernels.WEIGHT_LIMIT).all()
    assert (np.abs(models.final_weights) <= deep_mixing_kernels.WEIGHT_LIMIT).all()
    assert ((models.contexts & 255) <= deep_mixing_kernels.FAST_LIMIT).all()
    assert ((models.contexts >> 8) >= 0).all()
    assert ((models.contexts >> 8) < 65536).all()
    assert ((models.corrections >> 6) >= 0).all()
    assert ((models.corrections >> 6) < 65536).all()


def test_states_are_handed_out_as_copies() -> None:
    new_map_models().contexts[:] = 0
    assert new_map_models().contexts.any()
    models = new_map_models()
    copy = models.copy()
    copy.weights[:] = 0
    assert models.weights.any()
    deep = trained_deep_diff_models().copy()
    deep_copy = deep.copy()
    for array in deep_copy.mixer:
        array[:] = 0
    assert all(array.any() for array in deep.mixer)
    deep.adopt(deep_copy)
    assert not any(array.any() for array in deep.mixer)


def test_training_helps_small_meshes() -> None:
    octree = torus(40, 20, 8)
    trained = size(payloads(octree, new_map_models(), trained_diff_models()))
    untrained = size(payloads(octree, untrained_map_models(), untrained_diff_models()))
    assert trained < 0.97 * untrained
    deep = size(payloads(octree, new_deep_map_models(), trained_deep_diff_models()))
    assert deep < 0.97 * size(payloads(octree, untrained_deep_map_models(), untrained_deep_diff_models()))
    assert deep < trained


@pytest.mark.parametrize(
    ("mirror", "total", "checksum"), [(None, 619, 2375055616), (Mirror(1, 1023, 10), 624, 3049585386)]
)
def test_golden_bytes(mirror: Mirror | None, total: int, checksum: int) -> None:
    """The payloads of a fixed mesh never change within a format version, on any machine."""
    packets = payloads(lattice_soup(11, 200, 400, 10), new_map_models(), trained_diff_models(), mirror)
    assert size(packets) == total
    assert zlib.crc32(b"".join(packets)) == checksum


@pytest.mark.parametrize(
    ("mirror", "total", "checksum"), [(None, 622, 281117630), (Mirror(1, 1023, 10), 622, 2933607938)]
)
def test_golden_bytes_of_effort_high(mirror: Mirror | None, total: int, checksum: int) -> None:
    packets = payloads(lattice_soup(11, 200, 400, 10), new_deep_map_models(), trained_deep_diff_models(), mirror)
    assert (size(packets), zlib.crc32(b"".join(packets))) == (total, checksum)


def test_the_trained_states_that_slices_share_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        trained_diff_models().contexts[0] = 0
    trained_deep_diff_models().copy().weights[0] = 0
