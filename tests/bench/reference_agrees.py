"""The reference decoder against the core: python tests/bench/reference_agrees.py --meshes 300

First all golden streams; then random meshes. Each mesh is encoded in profile compact at both efforts and in profile
classic, with options drawn at random (B, base depth, mirror, slices, previews, depths of Diffs, strengths, filters);
half of the streams lose a third of their Diffs.
All levels and previews have to be the same to the last bit. Ends with exit code 1 if any are not, or if either decoder
refuses a stream.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from golden_streams import GOLDEN
from meshtide_codec.effort import Effort
from meshtide_codec.packets import PacketKind
from meshtide_codec.stream.container import read_container
from random_streams import check_agreement, classic_stream, compact_stream, random_mesh, without_some_diffs

WAYS = ("classic", *Effort)


def main() -> int:
    """Hold the decoders together; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", type=int, default=300)
    parser.add_argument("--vertices", type=int, default=80, help="of the largest mesh")
    parser.add_argument("--first", type=int, default=0, help="seed of the first mesh")
    arguments = parser.parse_args()
    levels: Counter[str] = Counter()
    failures = 0
    start = time.perf_counter()
    for path in sorted(GOLDEN.glob("*.tide")):
        header, packets = read_container(path.read_bytes())
        try:
            levels["golden"] += check_agreement(header, [p for p in packets if p.kind is not PacketKind.ORDER])
        except Exception:  # noqa: BLE001 - whatever it is, the other streams are tried as well
            failures += 1
            print(f"{path.name}:\n{traceback.format_exc()}")
    for seed in range(arguments.first, arguments.first + arguments.meshes):
        for way in WAYS:
            rng = np.random.default_rng([seed, WAYS.index(way)])
            try:
                mesh = random_mesh(rng, arguments.vertices)
                make = classic_stream if way == "classic" else partial(compact_stream, effort=Effort(way))
                header, packets = make(rng, mesh)
                count = check_agreement(header, without_some_diffs(rng, packets) if rng.integers(2) else packets)
                levels[way] += count
                failures += not count
            except Exception:  # noqa: BLE001 - whatever it is, the other meshes are tried as well
                failures += 1
                print(f"mesh {seed}, {way}:\n{traceback.format_exc()}")
    told = ", ".join(f"{way} {levels[way]}" for way in ("golden", *WAYS))
    print(f"{arguments.meshes} meshes, levels held together: {told}; {failures} streams differ")
    print(f"{time.perf_counter() - start:.0f} s")
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
