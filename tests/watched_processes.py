"""Python processes that are watched: what they import, and which programs they start, they and their children.

A `sitecustomize` module, which every interpreter runs first, adds a hook for audit events (PEP 578) and writes at once
what it sees into a file for each process, so that those that are killed have told, too.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

_HOOK = """
import os, sys

_seen = set()
_report = os.path.join(os.environ["WATCHED_PROCESSES"], f"{os.getpid()}.txt")

def _tell(kind, names):
    with open(_report, "a", encoding="utf-8", errors="replace") as file:
        file.write("".join(f"{kind} {name}\\n" for name in names))

def _name(program):
    return os.path.basename(os.fsdecode(program)).partition(" ")[0]

def _watch(event, arguments):
    if event == "subprocess.Popen":
        executable, words = arguments[:2]
        _tell("program", [_name(executable or (words if isinstance(words, (str, bytes)) else words[0]))])
    elif event in ("os.exec", "os.posix_spawn", "os.spawn", "os.system"):
        _tell("program", [_name(arguments[event == "os.spawn"])])
    elif event == "import":
        package = arguments[0].partition(".")[0]
        if package not in _seen:
            _seen.add(package)
            _tell("package", [package])

sys.addaudithook(_watch)
"""


def watching(folder: Path) -> dict[str, str]:
    """The environment of processes that are watched; their reports come into `folder`, which is made."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(_HOOK)
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": path, "WATCHED_PROCESSES": str(folder)}


def reported(folder: Path, kind: str) -> list[set[str]]:
    """The names of all packages that were asked for, or of programs, for each process that has any."""
    found = []
    for path in sorted(folder.glob("*.txt")):
        lines = [line.partition(" ") for line in path.read_text(encoding="utf-8").splitlines()]
        if names := {name for said, _, name in lines if said == kind}:
            found.append(names)
    return found
