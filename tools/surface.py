"""Write down all that users and programs hold on to: commands, settings, routes, exit codes.

    python tools/surface.py [--output FOLDER]

A test compares what this writes with what is kept in tests/end_to_end/surface, so that none of it changes unseen. After
a change that is meant, run this and commit the difference with it.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import io
import json
import os
import shlex
import sys
import tempfile
from pathlib import Path
from typing import Any

import typer

from meshtide_client.commands.application import build
from meshtide_client.commands.deferred import deferred
from meshtide_codec.command_line import ExitCode, run

FOLDER = Path(__file__).parents[1] / "tests" / "end_to_end" / "surface"
WIDTH = 120
"""Characters of a line of help; longer ones continue in the next."""
NOBODY = "http://127.0.0.1:9"
"""An address at which nothing listens."""
OFF = "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
CASES = f"""
nonsense
encode missing.off
encode bad.off
encode notes.txt
encode good.off -B 99
encode good.off --profile nonsense
encode good.off --effort nonsense
encode good.off -o missing/good.tide
encode good.off -o notes.txt
encode good.off
encode good.off --overwrite
encode good.tide
encode empty.off
decode missing.tide
decode damaged.tide
decode good.tide -o good.doc
decode good.tide --format doc
decode good.tide -o decoded.off
decode good.tide -o decoded.off
decode good.tide --level 99 -o other.off
info good.tide
info missing.tide
info damaged.tide
compare missing.off
compare bad.off
serve
serve missing
serve good.off
serve . --port 70000
serve . --port nonsense
serve . --bits 99
serve . --profile nonsense
serve . --profile classic --effort high
serve . --log-level nonsense
serve . --metrics nonsense
serve . --bytes-per-second 5
serve . --trusted-proxy nonsense
serve . --store kept
serve . --set nonsense=1
serve . --set max_upload
serve . --set max_upload=none
serve . --set write_tokens=secret
serve . --port 0 --set port=0
serve . --settings missing.toml
serve . --settings notes.txt
serve . --settings wrong.toml
serve . --host 192.0.2.1
serve . --ready-file notes.txt
serve . --set write_tokens_file=missing.txt
copy-store
copy-store missing copy
copy-store store copy
copy-store damaged-store copy
check-store missing
check-store store
check-store damaged-store
check-store ftp://host/folder
fetch
fetch localhost/meshes/patch
fetch {NOBODY}/meshes/patch
fetch {NOBODY}/meshes/patch -o patch.doc
fetch {NOBODY}/meshes/patch --timeout 0
fetch {NOBODY}/meshes/patch --until-level -1
fetch good.tide -o fetched.off
fetch damaged.tide -o damaged.off
fetch good.tide -o fetched.off --until-level 99 --overwrite
meshes
meshes {NOBODY}
meshes localhost
meshes {NOBODY} --box 1,2
ingest
ingest missing --server {NOBODY}
ingest good.off
ingest good.off --server {NOBODY}
ingest good.off --data kept
ingest damaged.tide --data kept
ingest bad.off --data kept
ingest good.off --store kept
ingest good.off --data kept --workers 2 --distributed nonsense
export
export missing --static site
export good.tide --static site
export good.tide --static site
export good.tide --static good.off
demo --mesh nonsense
edit {NOBODY}/meshes/patch
edit {NOBODY}/meshes/patch --name new
delete {NOBODY}/meshes/patch
delete {NOBODY}/meshes/patch --yes
tags {NOBODY}
render missing.off -o picture.png
render bad.off -o picture.png
render good.off -o picture.doc
render good.off -o picture.png
paper missing.off
simulate missing.off
simulate missing.off --loss loss:0.1
simulate good.off --loss nonsense
"""


def main() -> None:
    """Write all files anew, and remove those that stand for nothing any more."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=FOLDER, help="folder; tests/end_to_end/surface by default")
    folder: Path = parser.parse_args().output.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    files = surface()
    for path in sorted(folder.iterdir()):
        if path.name not in files:
            path.unlink()
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


def surface() -> dict[str, str]:
    """The text of each file."""
    for name in [name for name in os.environ if name.startswith("MESHTIDE_")]:
        del os.environ[name]
    os.environ.update(COLUMNS=str(WIDTH), TERM="dumb", NO_COLOR="1")
    group: Any = typer.main.get_command(build())
    commands = list(group.commands)
    files = {"help.txt": help_of([]), "openapi.json": openapi(), "settings.txt": settings()}
    files |= {f"help-{name}.txt": help_of([name]) for name in commands}
    return files | {"exit-codes.txt": exit_codes(commands)}


def help_of(arguments: list[str]) -> str:
    """What `--help` prints, without colours, in lines of WIDTH characters."""
    _, text = _ending([*arguments, "--help"])
    return "\n".join(line.rstrip() for line in text.splitlines()).strip() + "\n"


def openapi() -> str:
    """The document of the HTTP interface, without what the framework brings along and the program's version."""
    from meshtide_server import Settings, create_app  # noqa: PLC0415 - slow, and only for this

    document = create_app(Settings(samples=True)).openapi()
    document.pop("openapi")
    document["info"].pop("version")
    for operation in (each for path in document["paths"].values() for each in path.values()):
        operation.get("parameters", []).sort(key=lambda parameter: (parameter["in"], parameter["name"]))
    for name in ("HTTPValidationError", "ValidationError"):
        document["components"]["schemas"].pop(name, None)
    return json.dumps(document, indent=1, ensure_ascii=False, sort_keys=True) + "\n"


def settings() -> str:
    """Every setting of the server: name, kind, limits, default."""
    from meshtide_server import Settings  # noqa: PLC0415 - slow, and only for this

    lines = []
    for name, field in Settings.model_fields.items():
        default = str(field.get_default(call_default_factory=True))
        limits = "".join(f", {limit}" for limit in field.metadata if type(limit).__name__ in {"Ge", "Gt", "Le", "Lt"})
        kind = getattr(field.annotation, "__name__", "") if isinstance(field.annotation, type) else ""
        lines.append(f"{name} (MESHTIDE_{name.upper()}): {kind or field.annotation}{limits}; default {default}")
        lines.append(f"    {field.description}")
    return "\n".join(lines) + "\n"


def exit_codes(commands: list[str]) -> str:
    """How each case ends, in a folder made for that."""
    fixed = ["", "--version", "--help", *(f"{name} --no-such-option" for name in commands)]
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        asyncio.run(_prepare(Path()))
        os.environ["MESHTIDE_PORT"] = "0"  # another server may have the usual one
        ended = [(case, _ending(shlex.split(case))[0]) for case in (*fixed, *CASES.strip().splitlines())]
    return "".join(f"{code.value:3} {code.name:12} meshtide {case}".rstrip() + "\n" for case, code in ended)


async def _prepare(folder: Path) -> None:
    """Files for the cases."""
    from meshtide_server.store import open_store  # noqa: PLC0415 - slow, and only for this

    (folder / "good.off").write_text(OFF)
    (folder / "empty.off").touch()
    (folder / "bad.off").write_text("OFF 3 1 0\n0 0 0\n")
    (folder / "notes.txt").write_text("Not one of meshtide's files.\n")
    (folder / "damaged.tide").write_bytes(b"TIDE of nothing")
    (folder / "wrong.toml").write_text("nonsense = 1\n")
    for name in ("store", "damaged-store"):
        store = open_store(name)
        await store.put("streams/" + "ab" * 32 + ".tide", b"of another digest")
        await store.close()
    for path in (folder / "store").rglob("*.tide"):
        path.unlink()


def _ending(arguments: list[str]) -> tuple[ExitCode, str]:
    """How the command ends, and what it has printed."""
    before, sys.argv = sys.argv, ["meshtide", *arguments]
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            run(deferred(build()))
    except SystemExit as ending:
        return ExitCode(int(ending.code or 0)), printed.getvalue()
    finally:
        sys.argv = before


if __name__ == "__main__":
    main()
