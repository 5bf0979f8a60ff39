"""Write all golden streams anew, as the encoder of today makes them.

    python tools/make_golden.py [--output FOLDER]

They are to change only with the format: the tests hold encoder, decoder and reference decoder against them. Streams of
variants that are no more are removed. What changed is told, and `git diff --stat tests/golden` shows it too.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from golden_streams import GOLDEN, VARIANTS


def main() -> None:
    """Write the stream of each variant, and remove all others."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=GOLDEN, help="folder of the streams; tests/golden by default")
    folder: Path = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(folder.glob("*.tide")):
        if path.stem not in VARIANTS:
            path.unlink()
            print(f"{path}: removed")
    for name, variant in VARIANTS.items():
        path = folder / f"{name}.tide"
        before = path.read_bytes() if path.exists() else None
        data = variant.encode().to_bytes()
        path.write_bytes(data)
        print(f"{path}: {'as before' if data == before else 'new' if before is None else 'changed'}, {len(data)} bytes")


if __name__ == "__main__":
    main()
