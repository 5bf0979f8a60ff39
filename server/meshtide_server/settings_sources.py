"""Where settings come from: arguments win over the environment, which wins over a file, which wins over the defaults.

The file is TOML, with the settings' names as keys::

    directory = "meshes"
    port = 8080
    allowed_origins = ["https://museum.example"]
    max_upload = 100_000_000
"""

from __future__ import annotations

import os
import tomllib
from typing import TYPE_CHECKING, Any, get_args

from pydantic import SecretStr

from meshtide_codec.errors import OptionError
from meshtide_server.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from pydantic import ValidationError

LARGEST_FILE = 1 << 20


def load_settings(given: Mapping[str, Any], *, assigned: Iterable[str] = (), file: Path | None = None) -> Settings:
    """The settings of a server.

    Args:
        given: those that arguments of their own give.
        assigned: more of them, each as "name=value".
        file: the file, or None.

    Raises:
        OptionError: the file cannot be read, or a name is none of a setting, or given twice, or a secret's.
        pydantic.ValidationError: a value outside its range, or nothing to host.
    """
    arguments = dict(given)
    for name, value in map(_assignment, assigned):
        if name in arguments:
            raise OptionError(f"{name} is given twice")
        arguments[name] = value
    values = {
        name: value
        for name, value in (_read(file) if file is not None else {}).items()
        if name not in arguments and not os.environ.get(f"MESHTIDE_{name.upper()}")
    }
    return Settings(**values, **arguments)


def explanation(error: ValidationError) -> str:
    """What is wrong with the settings, in one line."""
    parts = []
    for detail in error.errors():
        name = ".".join(str(part) for part in detail["loc"])
        message = detail["msg"].removeprefix("Value error, ")
        parts.append(f"{name}: {message}" if name else message)
    return "; ".join(parts)


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    name = name.strip().removeprefix("MESHTIDE_").lower().replace("-", "_")
    if not equals:
        raise OptionError(f"{text!r} sets nothing; write it as NAME=VALUE, such as max_upload=1000000")
    if _is_secret(_known(name)):
        raise OptionError(f"{name} is a secret, and everybody on the machine can read arguments; use the environment")
    return name, value.strip()


def _read(file: Path) -> dict[str, Any]:
    try:
        with file.open("rb") as opened:
            data = opened.read(LARGEST_FILE + 1)
        if len(data) > LARGEST_FILE:
            raise OptionError(f"{file} has more than {LARGEST_FILE} bytes; it should hold settings")
        values = tomllib.loads(data.decode())
    except OSError as error:
        raise OptionError(f"the settings in {file} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise OptionError(f"{file} is not text") from error
    except tomllib.TOMLDecodeError as error:
        raise OptionError(f"{file} is not TOML: {error}") from error
    for name in values:
        _known(name)
    return values


def _known(name: str) -> str:
    if name not in Settings.model_fields:
        raise OptionError(f"there is no setting {name[:100]!r}; docs/operate.md lists them all")
    return name


def _is_secret(name: str) -> bool:
    """Whether a setting holds a secret itself, rather than the name of a file with one."""
    kinds = [Settings.model_fields[name].annotation]
    while kinds:
        kind = kinds.pop()
        if kind is SecretStr:
            return True
        kinds += get_args(kind)
    return False
