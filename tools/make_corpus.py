"""Seeds for the core's fuzzers, from the golden streams: python tools/make_corpus.py build/corpus.

For each target of codec/core/fuzz a folder of small files: `header` takes the bytes of a header, `decoder` a header
with its length in two bytes before it and the packets behind it, `entropy` the payloads. Nothing but Python is needed.
"""

from __future__ import annotations

import hashlib
import struct
import sys
from pathlib import Path

GOLDEN = Path(__file__).parents[1] / "tests" / "golden"
PREAMBLE = struct.Struct("<8sHII")
LARGEST_HEADER = 0xFFFF


def seeds(stream: bytes) -> dict[str, bytes]:
    """What a `.tide` file is to each target."""
    _, _, length, _ = PREAMBLE.unpack_from(stream)
    end = PREAMBLE.size + length
    header, packets = stream[PREAMBLE.size : end], stream[end:]
    if length > LARGEST_HEADER:
        raise ValueError(f"a header of {length} bytes is too long for a seed")
    return {"header": header, "decoder": struct.pack("<H", length) + header + packets, "entropy": packets}


def main(folder: Path) -> None:
    """Write the seeds, named by their contents, as libFuzzer does."""
    for path in sorted(GOLDEN.glob("*.tide")):
        for target, seed in seeds(path.read_bytes()).items():
            (folder / target).mkdir(parents=True, exist_ok=True)
            (folder / target / hashlib.sha1(seed, usedforsecurity=False).hexdigest()).write_bytes(seed)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
