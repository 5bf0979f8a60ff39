"""Options that several commands have alike: each is described here, and nowhere else.

What differs between commands, such as a default, is an argument of the functions at the end.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

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
        help="Replace existing files; without it, only files that this command made itself are replaced.",
    ),
]
MaxVerticesOption = Annotated[
    int | None,
    typer.Option(
        min=1, help="Accept levels of up to so many vertices, even from a very small file.", show_default=False
    ),
]
MaxFacesOption = Annotated[
    int | None,
    typer.Option(
        min=1, help="Accept levels of up to so many faces; by default four for each vertex.", show_default=False
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object.")]
MeshFormatOption = Annotated[
    str | None,
    typer.Option("--format", help="Format of the mesh file, such as obj; by default what its name says, or ply."),
]
ProcessesOption = Annotated[
    int | None, typer.Option(min=1, help="Number of processes.", show_default="one per processor")
]
UnprotectedOption = Annotated[
    str,
    typer.Option(help="What the link may lose besides Diffs: a list of base,map-conn,param,preview, or all."),
]


def bits_option(default: str | bool = True) -> Any:  # noqa: ANN401 - typer gives its kinds of options no name
    """The option -B, with what is shown as its default."""
    return typer.Option("-B", "--bits", help="Quantization bits per coordinate, 4 to 20.", show_default=default)


def profile_option(default: str | bool = True) -> Any:  # noqa: ANN401 - the same
    """The option --profile, with what is shown as its default."""
    return typer.Option(
        "--profile", help="Codec: compact (small files) or classic (the paper's, for study).", show_default=default
    )


def effort_option(default: str | bool = "default") -> Any:  # noqa: ANN401 - the same
    """The option --effort, with what is shown as its default."""
    return typer.Option(
        "--effort", help="compact: default, or high for smaller files that take longer.", show_default=default
    )


def drop_bits_option(prefix: str = "") -> Any:  # noqa: ANN401 - the same
    """The option -K; `prefix` names the profile where there are several."""
    return typer.Option("-K", "--drop-bits", help=f"{prefix}Bits per coordinate that each coarser level drops.")


def minimum_ratio_option(prefix: str = "") -> Any:  # noqa: ANN401 - the same
    """The option --minimum-ratio."""
    return typer.Option("--minimum-ratio", help=f"{prefix}Skip levels that merge fewer vertices than this ratio.")


def coarsest_vertices_option(prefix: str = "") -> Any:  # noqa: ANN401 - the same
    """The option --coarsest-vertices."""
    return typer.Option("--coarsest-vertices", help=f"{prefix}Stop at a level with no more vertices than this.")
