"""The files of docker/, read as the programs that they are for would."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

if TYPE_CHECKING:
    from types import ModuleType

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docker"


def instructions() -> list[tuple[str, str]]:
    """The Dockerfile's instructions, lines joined and comments left out."""
    text = re.sub(r"(?m)^#.*\n", "", (FOLDER / "Dockerfile").read_text())
    joined = text.replace("\\\n", " ")
    return [(line.split(maxsplit=1)[0], line.split(maxsplit=1)[1].strip()) for line in joined.splitlines() if line]


def final_stage() -> list[tuple[str, str]]:
    found = instructions()
    last = max(position for position, (name, _) in enumerate(found) if name == "FROM")
    return found[last:]


def image_environment() -> dict[str, str]:
    """What the image sets."""
    pairs = [pair for name, value in final_stage() if name == "ENV" for pair in value.split()]
    return dict(pair.split("=", 1) for pair in pairs)


def rendered_compose() -> str:
    """The compose file as it is with no variable set."""
    text = re.sub(r"\$\{[A-Z_0-9]+:-([^}]*)\}", r"\1", (FOLDER / "compose.yml").read_text())
    assert "${" not in text, "a variable without a default"
    return text.replace("$$", "$")


def compose() -> dict[str, Any]:
    """The same, parsed."""
    read: dict[str, Any] = yaml.safe_load(rendered_compose())
    return read


def service(name: str) -> dict[str, Any]:
    found: dict[str, Any] = compose()["services"][name]
    return found


def secret_maker() -> ModuleType:
    """docker/make_secrets.py."""
    specification = importlib.util.spec_from_file_location("make_secrets", FOLDER / "make_secrets.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module
