"""Time to encode and decode fans beside grids of as many triangles: python tests/bench/valence.py [--profile classic].

Process time of this thread after a warming run, in seconds, and how many times the grid's it is. A fan is a hub with
all its triangles around it: flat, a cone, or ragged, with rims of random radius on a wavy cone.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import encode
from meshtide_codec.mesh import Mesh
from meshtide_codec.profile import Profile

SHAPES = ("flat", "cone", "ragged")


def fan(count: int, shape: str) -> Mesh:
    """`count` triangles around vertex 0."""
    turn = 2 * np.pi * np.arange(count) / count
    radius = np.random.default_rng(1).uniform(1.0, 1.5, count) if shape == "ragged" else np.ones(count)
    height = 0.3 * radius * np.sin(5 * turn) if shape == "ragged" else np.zeros(count)
    rim = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    hub = np.array([[0.0, 0.0, 1.0 if shape == "cone" else 0.0]])
    step = np.arange(count)
    faces = np.stack([np.zeros(count, np.int64), 1 + step, 1 + (step + 1) % count], axis=1)
    return Mesh.checked(np.concatenate([hub, rim]), faces)


def grid(count: int) -> Mesh:
    """A bumpy open patch of about `count` triangles."""
    side = round((count / 2) ** 0.5) + 1
    u, v = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    corner = (u * side + v)[:-1, :-1].reshape(-1)
    lower = np.stack([corner, corner + side, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + side, corner + side + 1], axis=1)
    height = 3 * np.sin(u / 7) * np.cos(v / 5)
    return Mesh.checked(np.stack([u, v, height], axis=-1).reshape(-1, 3), np.concatenate([lower, upper]))


def seconds(mesh: Mesh, options: Profile) -> tuple[float, float, int]:
    """Of encoding and of decoding, and the bytes between."""
    start = time.thread_time()
    data = encode(mesh, options).to_bytes()
    middle = time.thread_time()
    decode(data)
    return middle - start, time.thread_time() - middle, len(data)


def main() -> None:
    """Time the grid and the fans of each size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="*", default=[8_000, 20_000, 100_000])
    parser.add_argument("--profile", choices=["compact", "classic"], default="compact")
    parser.add_argument("--effort", choices=["default", "high"], default="default")
    parser.add_argument("--bits", type=int, default=12)
    parser.add_argument("--shapes", nargs="*", choices=SHAPES, default=SHAPES)
    arguments = parser.parse_args()
    options: Profile
    if arguments.profile == "classic":
        options = ClassicOptions(bits=arguments.bits)
    else:
        options = CompactOptions(bits=arguments.bits, effort=arguments.effort)
    for warming in (grid(5000), fan(5000, "flat")):
        seconds(warming, options)
    for size in arguments.sizes:
        grid_encoding, grid_decoding, length = seconds(grid(size), options)
        print(
            f"{size:7} grid    encode {grid_encoding:6.2f} s        decode {grid_decoding:6.2f} s      {length:8} bytes"
        )
        for shape in arguments.shapes:
            encoding, decoding, length = seconds(fan(size, shape), options)
            print(
                f"{size:7} {shape:7} encode {encoding:6.2f} s {encoding / grid_encoding:4.1f}x "
                f"decode {decoding:6.2f} s {decoding / grid_decoding:4.1f}x {length:8} bytes"
            )


if __name__ == "__main__":
    main()
