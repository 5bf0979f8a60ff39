"""The journal of a sweep: what it is, and what is done of it, so that an interrupted one goes on.

`sweep.json` tells the version and the definition; `runs.jsonl` gets a line for each run that is done. Results of
another version or another sweep are never touched.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import OptionError
from meshtide_codec.output_files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

RESULTS_VERSION = 1
"""Goes up when a figure changes its meaning or its value."""

DEFINITION = "sweep.json"
RUNS = "runs.jsonl"


class Journal:
    """The journal in a folder; made if there is none.

    Args:
        folder: of the results.
        definition: plain values that tell the whole sweep.

    Raises:
        OptionError: the folder holds results of another version or sweep, or something else.
        OSError: it cannot be written.
    """

    def __init__(self, folder: Path, definition: Mapping[str, Any]) -> None:
        self._path = folder / RUNS
        told = {"meshtide": version("meshtide"), "results": RESULTS_VERSION, "sweep": definition}
        self.done: dict[int, dict[str, Any]] = {}
        if (folder / DEFINITION).exists():
            _compare(folder, told)
            self._read()
            return
        if folder.exists() and any(folder.iterdir()):
            raise OptionError(f"{folder} holds other files; name a new folder with -o")
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(folder / DEFINITION, (json.dumps(told, indent=1) + "\n").encode())

    def add(self, results: Iterable[dict[str, Any]]) -> None:
        """Note runs that are done."""
        with self._path.open("a", encoding="utf-8") as file:
            for result in results:
                self.done[result["run"]] = result
                file.write(json.dumps(result) + "\n")

    def close(self) -> None:
        """Put the lines into the order of the sweep, whatever order the processes had."""
        lines = [json.dumps(self.done[number]) + "\n" for number in sorted(self.done)]
        write_atomically(self._path, "".join(lines).encode())

    def _read(self) -> None:
        """Take over the runs that are done; a line that was cut off is done again."""
        if not self._path.exists():
            return
        for line in self._path.read_text(encoding="utf-8").splitlines():
            try:
                result = json.loads(line)
            except ValueError:
                continue
            self.done[result["run"]] = result
        self.close()


def _compare(folder: Path, told: Mapping[str, Any]) -> None:
    """Raise OptionError unless the folder's sweep is this one."""
    try:
        earlier = json.loads((folder / DEFINITION).read_text(encoding="utf-8"))
        versions = (earlier["meshtide"], earlier["results"])
        definition = earlier["sweep"]
    except (ValueError, KeyError, TypeError):
        raise OptionError(f"{folder / DEFINITION} is not that of a sweep; name a new folder with -o") from None
    if versions != (told["meshtide"], told["results"]):
        raise OptionError(
            f"{folder} holds results of meshtide {versions[0]} (results {versions[1]}); this is meshtide "
            f"{told['meshtide']} (results {told['results']}); name a new folder with -o"
        )
    mine = json.loads(json.dumps(told["sweep"]))
    if definition != mine:
        keys = sorted(set(mine) | set(definition))
        differing = [name for name in keys if definition.get(name) != mine.get(name)]
        raise OptionError(
            f"{folder} holds another sweep (it differs in {', '.join(differing)}); name a new folder with -o"
        )
