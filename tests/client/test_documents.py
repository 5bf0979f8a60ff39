"""The commands in the documents are commands that there are, with options that they have."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

from docker_files import compose
from meshtide_client.commands.application import build

ROOT = Path(__file__).parents[2]
DOCUMENTS = ["README.md", "docker/README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md")))]
LEAST = 30
"""Commands in all documents together; fewer would mean that this test does not find them."""


def command_lines(document: str) -> list[list[str]]:
    """The words of each line in the code blocks of a document."""
    blocks = re.findall(r"(?ms)^```\w*\n(.*?)^```", (ROOT / document).read_text())
    lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    return [shlex.split(line, comments=True) for line in lines if re.search(r"\b(meshtide|docker) ", line)]


def invocations(document: str) -> list[list[str]]:
    """What stands after each `meshtide` that is a program."""
    found = []
    for words in command_lines(document):
        starts = [place for place, word in enumerate(words) if word == "meshtide"]
        for start in starts[-1:]:  # that of a container comes after its service's name
            environment = all("=" in word for word in words[:start])
            if environment or "--entrypoint" in words:
                found.append(words[start + 1 :])
    return found


@pytest.fixture(scope="module")
def commands() -> dict[str, Any]:
    """The commands, by their names."""
    group: Any = typer.main.get_command(build())
    return dict(group.commands)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_commands_and_options_are_there(document: str, commands: dict[str, Any]) -> None:
    for name, *words in invocations(document):
        assert name in commands, f"meshtide {name}"
        known = {
            option for parameter in commands[name].params for option in (*parameter.opts, *parameter.secondary_opts)
        }
        given = {word.partition("=")[0] for word in words if re.fullmatch(r"--?[a-zA-Z][\w-]*(=.*)?", word)}
        assert given <= known | {"--help"}, f"meshtide {name} {' '.join(words)}"


def test_the_documents_hold_commands() -> None:
    assert sum(len(invocations(document)) for document in DOCUMENTS) >= LEAST


def test_container_commands_name_services_that_there_are() -> None:
    services = compose()["services"]
    lines = [words for words in command_lines("docker/README.md") if words[:2] == ["docker", "compose"]]
    assert len(lines) >= 10
    for words in lines:
        assert words[2:4] == ["--file", "docker/compose.yml"]
        if words[4] in {"exec", "run"}:
            plain = [word for word in words[5:] if not word.startswith("-")]
            assert set(plain) & set(services), words
