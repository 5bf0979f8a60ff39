"""What starting costs: python tests/bench/start_up.py [--runs 9]

Each program is a process of its own. Told is the least processor time of so many runs, in seconds, and what goes beyond
the program that the row is measured against. "Fresh" means that no file of meshtide has been compiled to bytecode yet,
as after an editable install; other packages' bytecode is there.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from meshtide_codec import encode, load_sample

BARE = """
import typer
app = typer.Typer(name="bare", no_args_is_help=True, pretty_exceptions_enable=False)
@app.callback()
def options():
    "A program."
@app.command()
def hello(name: str):
    "Say hello."
app()
"""
DECODE = "import sys, meshtide_codec; meshtide_codec.decode(open(sys.argv[1], 'rb').read())"
MESHTIDE = ("-m", "meshtide_client.main")


@dataclass(frozen=True)
class Row:
    """What one program takes.

    Args:
        name: of it.
        seconds: of processor time.
        beyond: the program that it is measured against.
        more: seconds more than that one takes.
    """

    name: str
    seconds: float
    beyond: str
    more: float


def processor_seconds(arguments: tuple[str, ...], runs: int, environment: dict[str, str] | None = None) -> float:
    """The least processor time of so many runs of Python with these arguments."""
    times = []
    for _ in range(runs):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [sys.executable, *arguments],
            check=True,
            stdout=subprocess.DEVNULL,
            env={**os.environ, **(environment or {})},
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(times)


def start_up_rows(runs: int = 9) -> list[Row]:
    """The rows of the table."""
    with tempfile.TemporaryDirectory() as folder:
        stream, mesh, bare, cache = (Path(folder) / name for name in ("spot.tide", "spot.ply", "bare.py", "cache"))
        stream.write_bytes(encode(load_sample("spot")).to_bytes())
        bare.write_text(BARE)
        cached = {"PYTHONPYCACHEPREFIX": str(cache), "PYTHONDONTWRITEBYTECODE": ""}
        decode = (*MESHTIDE, "decode", str(stream), "-o", str(mesh), "--overwrite")

        def least(*arguments: str) -> float:
            processor_seconds(arguments, 1, cached)  # fills the cache
            return processor_seconds(arguments, runs, cached)

        helps, bare_helps = least(*MESHTIDE, "--help"), least(str(bare), "--help")
        decodes, numpy = least("-c", DECODE, str(stream)), least("-c", "import numpy")
        command = least(*decode)
        nothing = least("-c", "pass")
        fresh = processor_seconds(decode, max(runs // 3, 1), {"PYTHONDONTWRITEBYTECODE": "1"})
    return [
        Row("meshtide --help", helps, "a bare typer program", helps - bare_helps),
        Row("import meshtide_codec, first decode of spot", decodes, "import numpy", decodes - numpy),
        Row("meshtide decode spot.tide", command, "an empty program", command - nothing),
        Row("meshtide decode spot.tide, fresh", fresh, "an empty program", fresh - nothing),
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=9)
    print("| program | seconds | beyond | seconds |")
    print("|---|---:|---|---:|")
    for row in start_up_rows(parser.parse_args().runs):
        print(f"| {row.name} | {row.seconds:.3f} | {row.beyond} | {row.more:.3f} |")


if __name__ == "__main__":
    main()
