"""Decoding by WebAssembly in Node against the native core: python tests/bench/wasm_speed.py [FILE.tide ...].

Without files: the bunny at both efforts. The whole decode with the finest level shown, in processor time, the least of
several runs; by then Node has compiled what it runs often. "First" is Node's very first decode, in time by the clock.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
import time
from pathlib import Path

from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.samples import load_sample

REPOSITORY = Path(__file__).parents[2]


def native_seconds(data: bytes) -> float:
    """Processor time of one decode."""
    start = time.thread_time()
    decode(data)
    return time.thread_time() - start


def by_node(file: Path, runs: int) -> tuple[float, float]:
    """The least processor time, and the first run's time by the clock."""
    program = Path(__file__).with_suffix(".mjs")
    command = ["node", str(program), str(REPOSITORY), str(file), str(runs)]
    told = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return told["least"], told["first"]


def main() -> None:
    """Print one line for each stream."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE.tide")
    parser.add_argument("--runs", type=int, default=10)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        files = arguments.files
        if not files:
            bunny = load_sample("stanford-bunny")
            for effort in Effort:
                file = Path(folder) / f"bunny-{effort}.tide"
                file.write_bytes(encode(bunny, CompactOptions(effort=effort)).to_bytes())
                files.append(file)
        print(f"{'stream':24} {'native ms':>10} {'Node ms':>10} {'ratio':>6} {'first ms':>10}")
        for file in files:
            data = file.read_bytes()
            native = min(native_seconds(data) for _ in range(arguments.runs))
            least, first = by_node(file, arguments.runs)
            native = min(native, *(native_seconds(data) for _ in range(arguments.runs)))
            print(f"{file.stem:24} {1e3 * native:10.1f} {1e3 * least:10.1f} {least / native:6.2f} {1e3 * first:10.1f}")


if __name__ == "__main__":
    main()
