"""The container's files: no engine is needed to see that they say what they should."""

import ast
import json
import re
from pathlib import Path

import pytest

from meshtide_server.settings import Settings

ROOT = Path(__file__).parents[2]
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


def environment() -> dict[str, str]:
    pairs = [pair for name, value in final_stage() if name == "ENV" for pair in value.split()]
    return dict(pair.split("=", 1) for pair in pairs)


def only(name: str) -> str:
    (value,) = [value for found, value in final_stage() if found == name]
    return value


def compose() -> list[tuple[str, str]]:
    """The compose file as (path, value) rows; enough of YAML for a file of maps and lists of scalars."""
    rows: list[tuple[str, str]] = []
    path: list[tuple[int, str]] = []
    for line in (FOLDER / "compose.yml").read_text().splitlines():
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        indent = len(line) - len(line.lstrip())
        while path and path[-1][0] >= indent:
            path.pop()
        key, _, value = line.strip().partition(": ")
        if line.lstrip().startswith("- "):
            key, value = "-", line.strip()[2:]
        path.append((indent, key.rstrip(":")))
        if value:
            rows.append((".".join(part for _, part in path), value.strip('"')))
    return rows


def values(path: str) -> list[str]:
    return [value for found, value in compose() if found == path]


def test_base_images_are_slim_and_named_without_a_host() -> None:
    bases = [value.split()[0] for name, value in instructions() if name == "FROM"]
    assert len(bases) == 2
    assert all(re.fullmatch(r"python:\$\{PYTHON_VERSION\}-slim", base) for base in bases)


def test_nothing_names_another_host() -> None:
    (image,) = values("services.meshtide.image")
    assert re.fullmatch(r"[a-z]+", image)
    for path in FOLDER.iterdir():
        text = path.read_text()
        assert "--index" not in text, path.name
        hosts = set(re.findall(r"https?://([^/:\s'\"]+)", text))
        assert hosts <= {"127.0.0.1"}, path.name


def test_the_process_has_no_privileges() -> None:
    user = only("USER")
    assert re.fullmatch(r"[1-9]\d*:[1-9]\d*", user)
    assert f"--uid {user.split(':')[0]} " in " ".join(value for name, value in final_stage() if name == "RUN")
    names = [name for name, _ in final_stage()]
    assert names.index("USER") < names.index("ENTRYPOINT")
    assert values("services.meshtide.cap_drop.-") == ["ALL"]
    assert values("services.meshtide.security_opt.-") == ["no-new-privileges:true"]


def test_the_environment_is_one_that_the_settings_know(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    variables = {name: value for name, value in environment().items() if name.startswith("MESHTIDE_")}
    assert {name.removeprefix("MESHTIDE_").lower() for name in variables} <= set(Settings.model_fields)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    settings = Settings(directory=tmp_path)
    assert (settings.host, settings.port, settings.cache) == ("0.0.0.0", 8000, Path("/cache"))  # noqa: S104 - in there
    known = {f"MESHTIDE_{name.upper()}" for name in Settings.model_fields}
    inside = {path.rsplit(".", 1)[1] for path, _ in compose() if ".environment." in path}
    assert inside <= known


def test_the_outside_sees_loopback_only() -> None:
    assert only("EXPOSE") == "8000"
    assert values("services.meshtide.ports.-") == ["127.0.0.1:${MESHTIDE_PORT:-8000}:8000"]


def test_health_is_asked_with_what_is_in_the_image() -> None:
    test = json.loads(only("HEALTHCHECK").split("CMD", 1)[1])
    assert test[:2] == ["python", "-c"]
    ast.parse(test[2])
    assert "/healthz" in test[2]
    (inside,) = values("services.meshtide.healthcheck.test")
    assert json.loads(inside)[:3] == ["CMD", "python", "-c"]
    ast.parse(json.loads(inside)[3])


def test_kernels_are_compiled_in_the_image_for_every_processor() -> None:
    build = [value for name, value in instructions() if name == "RUN" and "warm_up" in value]
    assert len(build) == 1
    assert environment()["NUMBA_CPU_NAME"] == "generic"
    folder = environment()["NUMBA_CACHE_DIR"]
    assert [value for name, value in instructions() if name == "ENV" and f"NUMBA_CACHE_DIR={folder}" in value]
    assert f"chown --recursive meshtide:meshtide {folder}" in [value for name, value in final_stage() if name == "RUN"]


def test_meshes_are_read_only_and_the_cache_lasts() -> None:
    assert json.loads(only("VOLUME")) == ["/meshes", "/cache"]
    assert values("services.meshtide.volumes.-") == ["${MESHTIDE_MESHES:-./meshes}:/meshes:ro", "cache:/cache"]
    assert json.loads(only("ENTRYPOINT")) == ["meshtide", "serve"]


def test_compose_limits_and_restarts() -> None:
    assert values("services.meshtide.restart") == ["unless-stopped"]
    assert values("services.meshtide.deploy.resources.limits.memory")
    assert values("services.meshtide.deploy.resources.limits.cpus")
    (grace,) = values("services.meshtide.stop_grace_period")
    assert int(grace.removesuffix("s")) > Settings(samples=True).shutdown_timeout + 5


def test_the_build_context_holds_all_that_is_copied() -> None:
    ignored = (ROOT / ".dockerignore").read_text().splitlines()
    assert "*" in ignored
    copied = [value.split()[:-1] for name, value in instructions() if name == "COPY" and "--from" not in value]
    for source in (name for names in copied for name in names):
        assert (ROOT / source).exists(), source
        assert f"!{source}" in ignored
