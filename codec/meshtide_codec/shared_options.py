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
