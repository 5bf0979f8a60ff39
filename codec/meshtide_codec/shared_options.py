"""Options that commands of several packages have alike."""

from __future__ import annotations

from typing import Annotated

import typer

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
