from __future__ import annotations

from command_runner import meshtide


def test_every_command_has_help_with_an_example() -> None:
    for command in ("encode", "decode", "info", "sphere"):
        text = meshtide(command, "--help").stdout
        assert f"Example: meshtide {command}" in text
