"""Rates and speed of profile compact's Map and Diff coders, without connectivity.

    python tests/bench/geometry_rates.py [--bits 12] [--slices 1] MESH...

Prints for each mesh the bits per vertex of its Maps and Diffs, and the process time of coding and decoding in
microseconds per vertex, rings included, kernels compiled before; every mesh is decoded and compared.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from meshtide_codec.compact.diff_coder import known_positions, new_slice_state
from meshtide_codec.compact.level import root_level
from meshtide_codec.compact.mirror import Mirror, find_mirror
from meshtide_codec.compact.models import new_map_models
from meshtide_codec.compact.octree import Octree, build_octree
from meshtide_codec.compact.slices import Slices, even_slices
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.quantize import quantize
from payloads import decode_diff, decode_map, encode_diff, encode_map

Packets = dict[tuple[int, int], bytes]
MAP = -1  # stands for a slice in the key of a Map


def coded(octree: Octree, slices: Slices, mirror: Mirror | None) -> Packets:
    packets = {}
    models = new_map_models()
    states = [new_slice_state(octree.levels[0], slices, index) for index in range(len(slices))]
    for depth in range(1, octree.bits + 1):
        coarse, fine = octree.levels[depth - 1], octree.levels[depth]
        if not coarse.all_leaves:
            packets[depth, MAP] = encode_map(coarse, fine, octree.bits, models, mirror)
        for index, state in enumerate(states):
            packets[depth, index] = encode_diff(octree, depth, state, slices, index, mirror)
    return packets


def decoded(octree: Octree, packets: Packets, slices: Slices, mirror: Mirror | None) -> bool:
    """Decode with the octree's faces; whether all positions come back."""
    count = len(octree.positions)
    models, level = new_map_models(), root_level(count)
    states = [new_slice_state(level, slices, index) for index in range(len(slices))]
    for depth in range(1, octree.bits + 1):
        if (depth, MAP) in packets:
            level = decode_map(packets[depth, MAP], level, octree.bits, models, count, mirror)
            faces = octree.levels[depth].faces
            level = level.with_faces(np.zeros((0, 3), np.int32) if faces is None else faces)
        else:
            level = level.deepened()
        for index, state in enumerate(states):
            decode_diff(packets[depth, index], level, state, slices, index, mirror)
    middles, _ = known_positions(level, states, slices)
    return bool((middles == 2 * octree.positions + 1).all())


def measure(path: Path, bits: int, parts: int) -> str:
    quantized = quantize(load_mesh(path), bits)
    octree = build_octree(quantized.positions, quantized.faces, bits)
    slices = even_slices(next(level for level in octree.levels if level.all_leaves), bits, parts)
    mirror = find_mirror(octree.positions, bits)
    decoded(octree, coded(octree, slices, mirror), slices, mirror)
    octree = build_octree(quantized.positions, quantized.faces, bits)
    start = time.process_time()
    packets = coded(octree, slices, mirror)
    middle = time.process_time()
    right = decoded(octree, packets, slices, mirror)
    end = time.process_time()
    count = len(octree.positions)
    maps = sum(len(packet) for (_, part), packet in packets.items() if part == MAP) * 8 / count
    diffs = sum(len(packet) for (_, part), packet in packets.items() if part != MAP) * 8 / count
    speed = f"coding {(middle - start) / count * 1e6:5.2f}  decoding {(end - middle) / count * 1e6:5.2f} us/vertex"
    plane = "no mirror" if mirror is None else f"mirror {'xyz'[mirror.axis]}"
    return f"{path.name:20} {count:8} map {maps:6.3f}  diff {diffs:6.3f}  {speed}  {plane}{'' if right else '  WRONG'}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--bits", type=int, default=12)
    parser.add_argument("--slices", type=int, default=1)
    arguments = parser.parse_args()
    for path in arguments.meshes:
        print(measure(path, arguments.bits, arguments.slices), flush=True)


if __name__ == "__main__":
    main()
