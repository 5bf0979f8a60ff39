import subprocess
import sys
from pathlib import Path

import httpx
import pytest

import meshtide_server
from meshtide_server.app import create_app
from meshtide_server.settings import Settings


def test_the_package_exports_the_factory_and_the_settings() -> None:
    assert set(dir(meshtide_server)) == {"Settings", "create_app"}
    assert meshtide_server.create_app is create_app
    with pytest.raises(AttributeError, match="has no attribute 'missing'"):
        _ = meshtide_server.missing


def test_the_serving_process_loads_nothing_that_encodes() -> None:
    program = (
        "import sys, meshtide_server.serving, meshtide_server.app; "
        "print([name for name in ('scipy', 'trimesh', 'meshtide_client') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


async def answer(settings: Settings, path: str, headers: dict[str, str]) -> httpx.Response:
    app = create_app(settings)
    async with app.router.lifespan_context(app):
        await app.parts.library.folder.settled()
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as client:
            return await client.get(path, headers=headers)


async def test_foreign_pages_read_nothing_unless_allowed(folder: Path) -> None:
    origin = {"Origin": "https://museum.example"}
    closed = await answer(Settings(directory=folder), "/meshes", origin)
    assert "access-control-allow-origin" not in closed.headers
    opened = await answer(
        Settings(directory=folder, allowed_origins=("https://museum.example",)), "/meshes/small.tide", origin
    )
    assert opened.headers["access-control-allow-origin"] == "https://museum.example"
    assert "Content-Range" in opened.headers["access-control-expose-headers"]
    other = await answer(
        Settings(directory=folder, allowed_origins=("https://other.example",)), "/meshes/small.tide", origin
    )
    assert "access-control-allow-origin" not in other.headers


async def test_an_application_can_be_started_twice(folder: Path) -> None:
    app = create_app(Settings(directory=folder))
    for _ in range(2):
        async with app.router.lifespan_context(app):
            await app.parts.library.folder.settled()
            assert app.parts.library.known("small") is not None
