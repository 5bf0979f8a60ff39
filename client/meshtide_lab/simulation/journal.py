"""The journal of a sweep: what it is, and what is done of it, so that an interrupted one goes on.

`sweep.json` holds the version and the definition; `runs.jsonl` gets a line for each run that is done. Results of
another version or another sweep are never touched.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import OptionError
from meshtide_codec.output_files import write_atomically
from meshtide_codec.output_policy import output_folder
from meshtide_codec.printable import shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

RESULTS_VERSION = 1
"""Goes up when a figure changes its meaning or its value."""

DEFINITION = "sweep.json"
RUNS = "runs.jsonl"
_REMEDY = "name a new folder with -o, or add --overwrite"


class Journal:
    """The journal in a folder; made if there is none.

    Args:
        folder: of the results.
        definition: plain values that describe the whole sweep.
        overwrite: whether results of another sweep, or anything else in the folder, may be replaced.

    Raises:
        OptionError: the folder holds results of another version or sweep, or something else.
        OSError: it cannot be written.
    """

    def __init__(self, folder: Path, definition: Mapping[str, Any], *, overwrite: bool = False) -> None:
        self._path = folder / RUNS
        described = {"meshtide": version("meshtide"), "results": RESULTS_VERSION, "sweep": definition}
        self.done: dict[int, dict[str, Any]] = {}
        self.goes_on = (folder / DEFINITION).exists() and _goes_on(folder, described, overwrite=overwrite)
        """Whether it is that of an earlier attempt at the same sweep."""
        if self.goes_on:
            self._read()
            return
        output_folder(folder)
        if not overwrite and folder.exists() and any(folder.iterdir()):
            raise OptionError(f"{shown(folder)} holds other files; {_REMEDY}")
        folder.mkdir(parents=True, exist_ok=True)
        self._path.unlink(missing_ok=True)
        write_atomically(folder / DEFINITION, (json.dumps(described, indent=1) + "\n").encode())

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


def _goes_on(folder: Path, described: Mapping[str, Any], *, overwrite: bool) -> bool:
    """Whether the folder's sweep is this one; another one is an error unless it may be replaced."""
    try:
        _compare(folder, described)
    except OptionError:
        if overwrite:
            return False
        raise
    return True


def _compare(folder: Path, described: Mapping[str, Any]) -> None:
    """Raise OptionError unless the folder's sweep is this one."""
    try:
        earlier = json.loads((folder / DEFINITION).read_text(encoding="utf-8"))
        versions = (earlier["meshtide"], earlier["results"])
        definition = earlier["sweep"]
    except (ValueError, KeyError, TypeError):
        raise OptionError(f"{folder / DEFINITION} is not that of a sweep; {_REMEDY}") from None
    if versions != (described["meshtide"], described["results"]):
        raise OptionError(
            f"{folder} holds results of meshtide {versions[0]} (results {versions[1]}); this is meshtide "
            f"{described['meshtide']} (results {described['results']}); {_REMEDY}"
        )
    mine = json.loads(json.dumps(described["sweep"]))
    if definition != mine:
        keys = sorted(set(mine) | set(definition))
        differing = [name for name in keys if definition.get(name) != mine.get(name)]
        raise OptionError(f"{folder} holds another sweep (it differs in {', '.join(differing)}); {_REMEDY}")
