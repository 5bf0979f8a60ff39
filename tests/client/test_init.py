from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

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


WRONG: dict[str, tuple[Callable[[Any], object], list[Any]]] = {
    "fetch": (meshtide_client.fetch, [None, 3, Path("a.tide")]),
    "until": (lambda wrong: meshtide_client.fetch("http://127.0.0.1:9/meshes/a", until=wrong), [3, "level"]),
    "link": (lambda wrong: meshtide_client.fetch("http://127.0.0.1:9/meshes/a", link=wrong), [30.0]),
    "limits": (lambda wrong: meshtide_client.fetch("http://127.0.0.1:9/meshes/a", limits=wrong), [1000]),
    "stream": (lambda wrong: asyncio.run(anext(meshtide_client.stream(wrong))), [None, 3]),
    "list_meshes": (meshtide_client.list_meshes, [None, 3]),
    "search": (lambda wrong: meshtide_client.list_meshes("http://127.0.0.1:9", search=wrong), ["bust"]),
    "list_tags": (meshtide_client.list_tags, [None]),
    "change_mesh": (lambda wrong: meshtide_client.change_mesh(wrong, name="a"), [None]),
    "delete_mesh": (meshtide_client.delete_mesh, [None]),
    "ServerAddress": (meshtide_client.ServerAddress.parse, [None, 3]),
    "MeshAddress": (meshtide_client.MeshAddress.parse, [None, 3]),
}


@pytest.mark.parametrize("door", WRONG)
def test_a_wrong_type_is_told(door: str) -> None:
    call, arguments = WRONG[door]
    for wrong in arguments:
        with pytest.raises(TypeError, match=f" must be of type .*, not {type(wrong).__name__}"):
            call(wrong)
