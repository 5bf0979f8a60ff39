"""Options that commands of several packages have alike."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def named_path(text: str) -> Path:
    """The path of a file as a person typed it: ``-`` alone is a pipe, and ``./-`` a file of that name.

    >>> str(named_path("-")), named_path("./-").is_absolute(), str(named_path("a/-")), str(named_path("./a"))
    ('-', True, 'a/-', 'a')
    """
    path = Path(text)
    return Path.cwd() / path if str(path) == "-" != text else path


OverwriteOption = Annotated[
    bool,
    typer.Option(
        "--overwrite",
        help="Replace files that are there already; without it nothing is replaced that this command did not make.",
    ),
]
MaxVerticesOption = Annotated[
    int | None,
    typer.Option(min=1, help="Accept levels of so many vertices, however few bytes claim them.", show_default=False),
]
MaxFacesOption = Annotated[
    int | None,
    typer.Option(min=1, help="The same of faces; by default four for each vertex accepted.", show_default=False),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the answer as one JSON object.")]
