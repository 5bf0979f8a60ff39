"""Write the golden streams of the newest format version.

Usage: python tools/make_golden.py tests/golden

Run it once, when a format version is made; once that has been released the files are frozen and the tests hold every
later program against them. It refuses to replace a file.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from golden_streams import GOLDEN_VARIANTS, VARIANTS
from meshtide_codec.stream.header import FORMAT_VERSION


def main(folder: Path) -> None:
    """Write each variant that is not there yet."""
    target = folder / f"version-{FORMAT_VERSION}"
    target.mkdir(exist_ok=True)
    for name in GOLDEN_VARIANTS[FORMAT_VERSION]:
        path = target / f"{name}.tide"
        if path.exists():
            print(f"{path}: kept")
            continue
        path.write_bytes(VARIANTS[name]().to_bytes())
        print(f"{path}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
