"""The container's files: no engine is needed to see that they say what they should."""

import ast
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from prometheus_client import Metric

from meshtide_server.metrics import REGISTRY
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


def compose() -> dict[str, Any]:
    """The compose file."""
    read: dict[str, Any] = yaml.safe_load((FOLDER / "compose.yml").read_text())
    return read


def service(name: str) -> dict[str, Any]:
    found: dict[str, Any] = compose()["services"][name]
    return found


def test_base_images_are_slim_and_named_without_a_host() -> None:
    bases = [value.split()[0] for name, value in instructions() if name == "FROM"]
    assert len(bases) == 2
    assert all(re.fullmatch(r"python:\$\{PYTHON_VERSION\}-slim", base) for base in bases)


def test_nothing_names_another_host() -> None:
    assert re.fullmatch(r"[a-z]+", service("meshtide")["image"])
    for name, other in compose()["services"].items():
        assert name == "meshtide" or re.fullmatch(r"([a-z]+/)?[a-z]+:v?[0-9]+\.[0-9.]+(-alpine)?", other["image"])
    for path in (path for path in FOLDER.iterdir() if path.is_file()):
        text = path.read_text()
        assert "--index" not in text, path.name
        hosts = set(re.findall(r"https?://([^/:;\s'\"]+)", text))
        assert hosts <= {"127.0.0.1", "meshtide"}, path.name


def test_the_process_has_no_privileges() -> None:
    user = only("USER")
    assert re.fullmatch(r"[1-9]\d*:[1-9]\d*", user)
    assert f"--uid {user.split(':')[0]} " in " ".join(value for name, value in final_stage() if name == "RUN")
    names = [name for name, _ in final_stage()]
    assert names.index("USER") < names.index("ENTRYPOINT")
    for each in compose()["services"].values():
        assert each["cap_drop"] == ["ALL"]
        assert each["security_opt"] == ["no-new-privileges:true"]


def test_the_environment_is_one_that_the_settings_know(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    variables = {name: value for name, value in environment().items() if name.startswith("MESHTIDE_")}
    assert {name.removeprefix("MESHTIDE_").lower() for name in variables} <= set(Settings.model_fields)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    settings = Settings(directory=tmp_path)
    assert (settings.host, settings.port, settings.cache) == ("0.0.0.0", 8000, Path("/cache"))  # noqa: S104 - in there
    known = {f"MESHTIDE_{name.upper()}" for name in Settings.model_fields}
    inside = service("meshtide")["environment"]
    assert inside.keys() <= known
    for name, value in inside.items():
        monkeypatch.setenv(name, re.sub(r"\$\{[A-Z_]+:-(.*)\}", r"\1", value))
    settings = Settings(directory=tmp_path)
    assert (settings.log_format, settings.metrics, settings.drain_timeout) == ("json", "open", 30)
    assert settings.trusted_proxies


def test_the_outside_sees_loopback_only() -> None:
    assert only("EXPOSE") == "8000"
    assert "ports" not in service("meshtide")
    published = [port for each in compose()["services"].values() for port in each.get("ports", ())]
    assert published
    assert all(port.startswith("127.0.0.1:") for port in published)
    assert service("proxy")["ports"] == ["127.0.0.1:${MESHTIDE_PORT:-8000}:8080"]


def test_health_is_asked_with_what_is_in_the_image() -> None:
    test = json.loads(only("HEALTHCHECK").split("CMD", 1)[1])
    assert test[:2] == ["python", "-c"]
    ast.parse(test[2])
    assert "/healthz" in test[2]
    inside = service("meshtide")["healthcheck"]["test"]
    assert inside[:3] == ["CMD", "python", "-c"]
    ast.parse(inside[3])
    assert "/readyz" in inside[3]
    assert service("proxy")["depends_on"] == {"meshtide": {"condition": "service_healthy"}}


def test_kernels_are_compiled_in_the_image_for_every_processor() -> None:
    build = [value for name, value in instructions() if name == "RUN" and "warm_up" in value]
    assert len(build) == 1
    assert environment()["NUMBA_CPU_NAME"] == "generic"
    folder = environment()["NUMBA_CACHE_DIR"]
    assert [value for name, value in instructions() if name == "ENV" and f"NUMBA_CACHE_DIR={folder}" in value]
    assert f"chown --recursive meshtide:meshtide {folder}" in [value for name, value in final_stage() if name == "RUN"]


def test_meshes_are_read_only_and_the_cache_lasts() -> None:
    assert json.loads(only("VOLUME")) == ["/meshes", "/cache"]
    assert service("meshtide")["volumes"] == ["${MESHTIDE_MESHES:-./meshes}:/meshes:ro", "cache:/cache"]
    assert json.loads(only("ENTRYPOINT")) == ["meshtide", "serve"]


def test_compose_limits_and_restarts() -> None:
    for each in compose()["services"].values():
        assert each["restart"] == "unless-stopped"
    meshtide = service("meshtide")
    assert meshtide["deploy"]["replicas"] >= 2
    assert set(meshtide["deploy"]["resources"]["limits"]) == {"cpus", "memory"}
    drain = int(meshtide["environment"]["MESHTIDE_DRAIN_TIMEOUT"])
    grace = int(meshtide["stop_grace_period"].removesuffix("s"))
    assert grace > drain + Settings(samples=True).shutdown_timeout + 5


def test_every_file_and_volume_that_compose_mounts_is_there() -> None:
    volumes = set(compose()["volumes"])
    for each in compose()["services"].values():
        for mount in each["volumes"]:
            source = mount.rsplit(":", 2 if mount.endswith(":ro") else 1)[0]
            assert source in volumes or "MESHTIDE_MESHES" in source or (FOLDER / source).is_file(), mount


def test_nginx_takes_its_file(tmp_path: Path) -> None:
    program = shutil.which("nginx", path="/usr/sbin:/usr/local/sbin:/usr/bin")
    if program is None:
        pytest.skip("nginx is not installed")
    text = (FOLDER / "nginx.conf").read_text()
    assert text.count("server meshtide:8000 ") == 1
    # Names are looked up when the file is read, and that of the servers exists among containers only.
    text = text.replace("meshtide:8000", "127.0.0.1:8000").replace("/tmp", str(tmp_path))  # noqa: S108 - in the file
    (tmp_path / "nginx.conf").write_text(text)
    done = subprocess.run(
        [program, "-t", "-p", tmp_path, "-c", tmp_path / "nginx.conf"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_proxy_waits_longer_than_a_stream_may_stand_still() -> None:
    text = (FOLDER / "nginx.conf").read_text()
    for name in ("proxy_read_timeout", "proxy_send_timeout"):
        (seconds,) = re.findall(rf"{name} (\d+)s;", text)
        assert int(seconds) > Settings(samples=True).stall_timeout


def test_prometheus_asks_for_metrics_that_there_are(tmp_path: Path) -> None:
    collecting = yaml.safe_load((FOLDER / "prometheus.yml").read_text())
    assert collecting["scrape_configs"][0]["dns_sd_configs"][0]["names"] == ["meshtide"]
    assert collecting["rule_files"] == ["alerts.yml"]
    (group,) = yaml.safe_load((FOLDER / "alerts.yml").read_text())["groups"]
    exposed = {name for family in REGISTRY.collect() for name in _series(family)}
    for rule in group["rules"]:
        assert set(re.findall(r"meshtide_\w+", rule["expr"])) <= exposed, rule["alert"]
        assert rule["annotations"]["summary"]
    program = shutil.which("promtool")
    if program is None:
        pytest.skip("promtool is not installed; the files were only held against the metrics")
    for name in ("prometheus.yml", "alerts.yml"):
        (tmp_path / name).write_text((FOLDER / name).read_text())
    done = subprocess.run(
        [program, "check", "config", tmp_path / "prometheus.yml"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def _series(family: Metric) -> set[str]:
    """The names under which a metric is told, also those that no sample has yet."""
    endings = {"counter": ("_total",), "histogram": ("_bucket", "_count", "_sum")}.get(family.type, ("",))
    return {family.name + ending for ending in endings}


def test_the_build_context_holds_all_that_is_copied() -> None:
    ignored = (ROOT / ".dockerignore").read_text().splitlines()
    assert "*" in ignored
    copied = [value.split()[:-1] for name, value in instructions() if name == "COPY" and "--from" not in value]
    for source in (name for names in copied for name in names):
        assert (ROOT / source).exists(), source
        assert f"!{source}" in ignored
