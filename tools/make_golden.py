"""Write the golden streams of this format version.

Usage: python tools/make_golden.py tests/golden

Run it once, when a format version is made; afterwards the files are frozen and the tests hold every later program
against them. It refuses to replace a file.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from golden_streams import VARIANTS


def main(folder: Path) -> None:
    """Write each variant that is not there yet."""
    for name, make in VARIANTS.items():
        path = folder / f"{name}.tide"
        if path.exists():
            print(f"{path}: kept")
            continue
        path.write_bytes(make().to_bytes())
        print(f"{path}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
