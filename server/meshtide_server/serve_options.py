"""The options of the command `serve`, made from the settings: each is described in one place, `Settings`."""

from __future__ import annotations

from inspect import Parameter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from meshtide_server.settings import Option, Settings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pydantic.fields import FieldInfo


def option_of(field: FieldInfo) -> Option | None:
    """How a setting is given to the command; None if it has no option of its own."""
    return next((each for each in field.metadata if isinstance(each, Option)), None)


def option_names() -> dict[str, str]:
    """What each setting that has an option is called there.

    >>> option_names()["allowed_origins"], option_names()["directory"]
    ('--allow-origin', 'DIRECTORY')
    """
    found = {}
    for name, field in Settings.model_fields.items():
        option = option_of(field)
        if option is not None:
            found[name] = name.upper() if option.argument else _long(name, option)
    return found


def serve_parameters() -> Iterator[Parameter]:
    """The parameters of the command, as typer reads them; None stands for what is not given."""
    for name, field in Settings.model_fields.items():
        option = option_of(field)
        if option is not None:
            kind = Annotated[_kind(field) | None, _typer(name, field, option)]  # type: ignore[valid-type]
            yield Parameter(name, Parameter.KEYWORD_ONLY, default=None, annotation=kind)


def _typer(name: str, field: FieldInfo, option: Option) -> Any:  # noqa: ANN401 - typer gives its kinds of options no name
    described = option.help or field.description
    if option.argument:
        return typer.Argument(help=described)
    bounds: dict[str, Any] = {}
    if option.bounded:
        for each in field.metadata:
            bounds |= {"min": getattr(each, "ge", None)} if hasattr(each, "ge") else {}
            bounds |= {"max": getattr(each, "le", None)} if hasattr(each, "le") else {}
    names = [*([option.short] if option.short else []), _long(name, option)]
    return typer.Option(*names, help=described, show_default=_default(field, option), **bounds)


def _long(name: str, option: Option) -> str:
    return f"--{option.name or name.replace('_', '-')}"


def _kind(field: FieldInfo) -> type:
    """What typer makes of a word: a flag, a number, a path, a list, or a text that the settings check."""
    kinds = {field.annotation, *get_args(field.annotation)}
    if tuple in kinds or any(getattr(kind, "__origin__", None) is tuple for kind in kinds):
        return list[str]
    return next((kind for kind in (bool, int, float, Path) if kind in kinds), str)


def _default(field: FieldInfo, option: Option) -> str | bool:
    default = field.default
    if option.default:
        return option.default
    if default is None or default == () or isinstance(default, bool):
        return True  # there is nothing to show
    if isinstance(default, tuple):
        return ", ".join(default)
    return f"{default:g}" if isinstance(default, float) else str(default)
