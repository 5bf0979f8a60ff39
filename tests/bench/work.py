"""How much the core works, in instructions: python tests/bench/work.py build/core-test/core_work [--store].

Instructions do not depend on what else a machine does, so they can be held against stored numbers (`work.json`, for
each compiler). More than 2 % beyond one ends with exit code 1: then the change was not worth it, or the numbers are
stored anew with `--store`; so are they when the format or the shape of the work changes. Fewer by as much is told, and
should be stored. Valgrind counts; the program is codec/core/bench/work.cpp, on a shipped mesh, one kind of work a run.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.samples import load_sample

STORED = Path(__file__).with_suffix(".json")
STATES = Path(__file__).parents[2] / "codec" / "meshtide_codec" / "states"
MESH = "spot"
SLACK = 0.02
WORK = ("decode", "encode", "surface")
COUNT = re.compile(r"I\s+refs:\s+([\d,]+)")


def instructions(program: Path, work: str, stream: Path) -> int:
    """How many one run takes."""
    command = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]
    told = subprocess.run([*command, program, STATES, work, stream], capture_output=True, text=True, check=False)
    found = COUNT.search(told.stderr)
    if told.returncode != 0 or found is None:
        raise RuntimeError(f"valgrind counted nothing: {told.stderr[-2000:]}")
    return int(found[1].replace(",", ""))


def counted(program: Path) -> dict[str, int]:
    """The instructions of each kind of work at each effort."""
    counts = {}
    with tempfile.TemporaryDirectory() as folder:
        stream = Path(folder) / "stream.tide"
        for effort in Effort:
            stream.write_bytes(encode(load_sample(MESH), CompactOptions(effort=effort)).to_bytes())
            decoding = instructions(program, "decode", stream)
            counts[f"decode {effort}"] = decoding
            counts[f"encode {effort}"] = instructions(program, "encode", stream) - decoding
            if effort is Effort.DEFAULT:  # previews do not depend on it
                counts["surface"] = instructions(program, "surface", stream) - decoding
    return counts


def main() -> int:
    """Count, compare or store; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path, help="core_work, as `make core-test` builds it")
    parser.add_argument("--store", action="store_true", help="the numbers of today, for this compiler")
    arguments = parser.parse_args()
    program = arguments.program.resolve()
    compiler = subprocess.run([program, "compiler"], capture_output=True, text=True, check=True).stdout.strip()
    stored = json.loads(STORED.read_text()) if STORED.is_file() else {}
    counts = counted(program)
    if arguments.store:
        STORED.write_text(json.dumps({**stored, compiler: counts}, indent=4, sort_keys=True) + "\n")
    elif compiler not in stored:
        print(f"nothing is stored for {compiler}, only for {', '.join(stored)}; --store does that")
        return 1
    before = counts if arguments.store else stored[compiler]
    more = 0
    for name, count in counts.items():
        change = count / before[name] - 1 if name in before else float("inf")
        word = "TOO MANY" if change > SLACK else "fewer: store them" if change < -SLACK else "as stored"
        more += change > SLACK
        print(f"{name:16} {count / 1e6:10.2f} million instructions, {change:+.2%}: {word}")
    return int(more > 0)


if __name__ == "__main__":
    sys.exit(main())
