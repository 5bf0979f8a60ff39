"""Write what the decoder in the browser must make of each golden stream: client/web/test/golden_levels.json.

::

    python tools/golden_levels.py

For each level its number, vertices, faces, and the SHA-256 of what is drawn: positions as float32, then faces as int32.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

from meshtide_codec.decoder import Decoder
from meshtide_codec.stream.container import read_container

REPOSITORY = Path(__file__).parents[1]
OUTPUT = REPOSITORY / "client/web/test/golden_levels.json"


def levels(stream: bytes) -> list[list[int | str]]:
    """The levels of a `.tide` file, coarse to fine."""
    header, packets = read_container(stream)
    decoder = Decoder(header)
    for packet in packets:
        decoder.push(packet)
    told: list[list[int | str]] = []
    for level in sorted({row.level for row in header.levels}, reverse=True):
        mesh = decoder.mesh(level)
        drawn = mesh.vertices.astype("<f4").tobytes() + mesh.faces.astype("<i4").tobytes()
        told.append([level, len(mesh.vertices), len(mesh.faces), hashlib.sha256(drawn).hexdigest()])
    return told


def text() -> str:
    """The file's contents, a line for each level."""
    streams = []
    for path in sorted((REPOSITORY / "tests/golden").glob("*.tide")):
        rows = ",\n".join(f"    {json.dumps(row)}" for row in levels(path.read_bytes()))
        streams.append(f'  "{path.stem}": [\n{rows}\n  ]')
    return "{\n" + ",\n".join(streams) + "\n}\n"


def main() -> int:
    """Write the file."""
    OUTPUT.write_text(text(), encoding="ascii")
    return 0


if __name__ == "__main__":
    sys.exit(main())
