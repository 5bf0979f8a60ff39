from __future__ import annotations

import subprocess
import sys

import pytest

import meshtide_client


def test_every_public_name_can_be_had() -> None:
    for name in meshtide_client.__all__:
        assert getattr(meshtide_client, name).__name__ == name


def test_public_names_are_listed() -> None:
    assert set(meshtide_client.__all__) <= set(dir(meshtide_client))


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'fish'"):
        _ = meshtide_client.fish


def test_the_import_is_light() -> None:
    code = "import sys, meshtide_client; print({'numpy', 'websockets', 'httpx'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
