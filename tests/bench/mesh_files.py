"""Reading mesh files, held against trimesh: python tests/bench/mesh_files.py [FOLDER] [--formats obj ply off stl gltf].

For each file of a folder and for generated ones: milliseconds of processor time, the least of several readings, of
`load_scene` and `load_mesh` and of trimesh's scene and its one mesh, and the peak memory of `load_scene` and trimesh as
a multiple of the file's size, each in a process of its own, without what the interpreter took before (Linux). A dash:
not read, or not in time. trimesh does not weld the corners of STL files, ours does; of glTF files it applies no skins.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from mesh_file_samples import samples

FORMATS = {"obj": [".obj"], "ply": [".ply"], "off": [".off"], "stl": [".stl"], "gltf": [".glb", ".gltf"]}
READ = """
import gc, json, logging, sys, time, warnings
from pathlib import Path
warnings.simplefilter("ignore")
logging.disable()
path, small, reader, rounds = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])
if reader.startswith("trimesh"):
    import trimesh
    load = lambda path: trimesh.load(path, process=False, maintain_order=True)
    one = lambda found: found.to_mesh() if isinstance(found, trimesh.Scene) else found
    read = load if reader == "trimesh" else lambda path: one(load(path))
else:
    import mapbox_earcut
    import meshtide_codec.mesh_files
    read = getattr(meshtide_codec.mesh_files, reader)
def peak():
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) * 1024
read(small)  # loads what is loaded late
before, seconds, memory = peak(), [], 0
for _ in range(rounds):
    start = time.process_time()
    found = read(path)
    seconds.append(time.process_time() - start)
    memory = memory or peak() - before
    del found
    gc.collect()
print(json.dumps([min(seconds), memory]))
"""
READERS = ("load_scene", "trimesh", "load_mesh", "trimesh, one mesh")
MEBIBYTE = 1 << 20
"""The memory of smaller files is that of the interpreter rather than theirs."""
LONGEST = 100  # seconds


def measured(path: Path, small: Path, reader: str, rounds: int) -> tuple[float, int] | None:
    """The least seconds and the bytes that a reader takes; None if it does not read the file."""
    command = [sys.executable, "-c", READ, str(path), str(small), reader, str(rounds)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired:
        return None
    if done.returncode:
        return None
    seconds, memory = json.loads(done.stdout)
    return seconds, memory


def row(path: Path, small: Path, rounds: int) -> str:
    """A line: what is read, how long each reader takes, how much faster ours are, and memory."""
    size = path.stat().st_size
    found = [measured(path, small, reader, rounds) for reader in READERS]
    times = ""
    for own, other in (found[:2], found[2:]):
        times += "".join(f"{1e3 * one[0]:11.2f}" if one else f"{'-':>11}" for one in (own, other))
        times += f"{other[0] / own[0]:7.2f}" if own and other else f"{'-':>7}"
    memory = "".join(f"{one[1] / size:9.1f}" if one and size >= MEBIBYTE else f"{'-':>9}" for one in found[:2])
    return f"{path.name[:32]:32}{size / 1e6:9.2f}{times}{memory}"


def report(folder: Path | None, kinds: list[str], vertices: int, rounds: int) -> Iterator[str]:
    """A line for each file."""
    times = "".join(f"{what:>11}{'trimesh ms':>11}{'x':>7}" for what in ("scene ms", "mesh ms"))
    yield f"{'file':32}{'MB':>9}{times}{'memory x':>9}{'trimesh':>9}"
    with tempfile.TemporaryDirectory() as made:
        for kind in kinds:
            small = None
            for name, write in samples(kind, 16):
                path = Path(made) / f"small-{name}"
                write(path)
                small = small or path
            assert small is not None
            found = [] if folder is None else sorted(folder.iterdir())
            for path in found:
                if path.suffix.lower() in FORMATS[kind]:
                    yield row(path, small, rounds)
            for name, write in samples(kind, vertices) if vertices else ():
                path = Path(made) / name
                write(path)
                yield row(path, small, rounds)
                path.unlink()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", help="of mesh files")
    parser.add_argument("--formats", nargs="+", choices=list(FORMATS), default=list(FORMATS))
    parser.add_argument("--vertices", type=int, default=1_000_000, help="of the generated meshes; 0 for none")
    parser.add_argument("--rounds", type=int, default=4)
    arguments = parser.parse_args()
    for line in report(arguments.folder, arguments.formats, arguments.vertices, arguments.rounds):
        print(line, flush=True)


if __name__ == "__main__":
    main()
