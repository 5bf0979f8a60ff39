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

from docker_files import (
    FOLDER,
    ROOT,
    compose,
    final_stage,
    image_environment,
    instructions,
    rendered_compose,
    secret_maker,
    service,
)
from meshtide_server.operations.metrics import REGISTRY
from meshtide_server.settings import Settings


def only(name: str) -> str:
    (value,) = [value for found, value in final_stage() if found == name]
    return value


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
        assert hosts <= {"127.0.0.1", "meshtide", "s3"}, path.name


def test_the_process_has_no_privileges() -> None:
    user = only("USER")
    assert re.fullmatch(r"[1-9]\d*:[1-9]\d*", user)
    assert f"--uid {user.split(':')[0]} " in " ".join(value for name, value in final_stage() if name == "RUN")
    names = [name for name, _ in final_stage()]
    assert names.index("USER") < names.index("ENTRYPOINT")
    for name, each in compose()["services"].items():
        assert each["cap_drop"] == ["ALL"]
        assert each["security_opt"] == ["no-new-privileges:true"]
        # the images of these two have users of their own, the others are told one
        assert name in {"meshtide", "prometheus"} or re.fullmatch(r"[1-9]\d*:[1-9]\d*", each["user"])


def test_the_environment_is_one_that_the_settings_know(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    variables = {name: value for name, value in image_environment().items() if name.startswith("MESHTIDE_")}
    assert {name.removeprefix("MESHTIDE_").lower() for name in variables} <= set(Settings.model_fields)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    settings = Settings(directory=tmp_path)
    assert (settings.host, settings.port, settings.cache) == ("0.0.0.0", 8000, Path("/cache"))  # noqa: S104 - in there
    known = {f"MESHTIDE_{name.upper()}" for name in Settings.model_fields}
    inside = service("meshtide")["environment"]
    assert {name for name in inside if name not in known} == {
        "AWS_ENDPOINT_URL",
        "AWS_REGION",
        "AWS_SHARED_CREDENTIALS_FILE",
    }
    for name, value in inside.items():
        monkeypatch.setenv(name, value)
    settings = Settings(directory=tmp_path)
    assert (settings.log_format, settings.metrics, settings.drain_timeout) == ("json", "open", 30)
    assert settings.trusted_proxies
    assert settings.keeps_meshes
    memory = int(service("meshtide")["deploy"]["resources"]["limits"]["memory"].removesuffix("g")) << 30
    needed = settings.encoder_processes * settings.job_memory + settings.max_upload + (settings.store_cache_mib << 20)
    assert needed + (1 << 30) <= memory


def test_the_outside_sees_loopback_only() -> None:
    assert only("EXPOSE") == "8000"
    assert "ports" not in service("meshtide")
    published = [port for each in compose()["services"].values() for port in each.get("ports", ())]
    assert published
    assert all(port.startswith("127.0.0.1:") for port in published)
    assert service("proxy")["ports"] == ["127.0.0.1:8000:8080"]


def test_health_is_asked_with_what_is_in_the_image() -> None:
    test = json.loads(only("HEALTHCHECK").split("CMD", 1)[1])
    assert test[:2] == ["python", "-c"]
    ast.parse(test[2])
    assert "/healthz" in test[2]
    inside = service("meshtide")["healthcheck"]["test"]
    assert inside[:3] == ["CMD", "python", "-c"]
    ast.parse(inside[3])
    assert "/readyz" in inside[3]
    for name, each in compose()["services"].items():
        assert (name in {"bucket", "prometheus"}) != ("healthcheck" in each)
        for other, needed in each.get("depends_on", {}).items():
            ends = compose()["services"][other]["restart"] == "on-failure"
            assert needed["condition"] == ("service_completed_successfully" if ends else "service_healthy")
    assert set(service("meshtide")["depends_on"]) == {"database", "bucket"}


def test_the_core_is_compiled_where_there_is_a_compiler_and_nowhere_else() -> None:
    lines = instructions()
    compiler = [
        at for at, (name, value) in enumerate(lines) if name == "RUN" and re.search(r"apt-get install .*g\+\+", value)
    ]
    wheel = [at for at, (name, value) in enumerate(lines) if name == "RUN" and "pip wheel" in value]
    assert len(compiler) == len(wheel) == 1
    assert compiler < wheel
    assert not any("apt-get" in value for _, value in final_stage())
    assert ("COPY", "codec codec") in lines[: wheel[0]]
    assert "**/libmeshtide_core_*" in (ROOT / ".dockerignore").read_text().splitlines()


def test_meshes_are_read_only_and_the_cache_lasts() -> None:
    assert json.loads(only("VOLUME")) == ["/meshes", "/cache"]
    assert service("meshtide")["volumes"] == ["./meshes:/meshes:ro", "cache:/cache"]
    assert json.loads(only("ENTRYPOINT")) == ["meshtide", "serve"]


def test_compose_limits_and_restarts() -> None:
    for name, each in compose()["services"].items():
        assert each["restart"] == ("on-failure" if name == "bucket" else "unless-stopped")
    meshtide = service("meshtide")
    assert meshtide["deploy"]["replicas"] >= 2
    assert set(meshtide["deploy"]["resources"]["limits"]) == {"cpus", "memory"}
    drain = int(meshtide["environment"]["MESHTIDE_DRAIN_TIMEOUT"])
    grace = int(meshtide["stop_grace_period"].removesuffix("s"))
    assert grace > drain + Settings(samples=True).shutdown_timeout + 5


def test_every_file_and_volume_that_compose_mounts_is_there() -> None:
    volumes = set(compose()["volumes"])
    for each in compose()["services"].values():
        for mount in each.get("volumes", ()):
            source = mount.rsplit(":", 2 if mount.endswith(":ro") else 1)[0]
            assert source in volumes or source == "./meshes" or (FOLDER / source).is_file(), mount
        assert set(each["networks"]) <= set(compose()["networks"])


def test_compose_takes_its_file() -> None:
    compose_spec = pytest.importorskip(
        "compose_spec", reason="compose-spec is not installed: no wheel for this machine"
    )
    parsed = compose_spec.PyCompose.from_yaml(rendered_compose())
    assert set(parsed.service_names()) == {"proxy", "meshtide", "database", "s3", "bucket", "prometheus"}
    with pytest.raises(ValueError, match="condition"):
        compose_spec.PyCompose.from_yaml(rendered_compose().replace("service_healthy", "service_happy"))


def test_what_is_inside_is_not_reached_from_outside() -> None:
    assert compose()["networks"]["back"] == {"internal": True}
    for name in ("database", "s3", "bucket"):
        assert service(name)["networks"] == ["back"]
        assert "ports" not in service(name)
    assert service("proxy")["networks"] == ["front"]


def test_secrets_are_files_that_the_program_beside_them_makes(tmp_path: Path) -> None:
    declared = {name: FOLDER / each["file"] for name, each in compose()["secrets"].items()}
    assert all(path == FOLDER / "secrets" / name for name, path in declared.items())
    assert "/secrets/" in (FOLDER / ".gitignore").read_text().splitlines()
    used = {name for each in compose()["services"].values() for name in each.get("secrets", ())}
    folder = tmp_path / "secrets"
    maker = secret_maker()
    made = maker.make(folder)
    assert {path.name for path in made} == used == set(declared)
    assert folder.stat().st_mode & 0o077 == 0
    assert all(path.stat().st_mode & 0o777 == 0o644 for path in made)
    named = [value for each in compose()["services"].values() for value in _texts(each) if "/run/secrets/" in value]
    assert {value.rpartition("/run/secrets/")[2] for value in named} == used
    for name in used:
        services = [each for each in compose()["services"].values() if f"/run/secrets/{name}" in " ".join(_texts(each))]
        assert all(name in each["secrets"] for each in services), name
    before = {path: path.read_text() for path in made}
    assert len(set(before.values())) == len(before)
    assert maker.make(folder) == []
    (folder / "write_tokens").unlink()
    assert [path.name for path in maker.make(folder)] == ["write_tokens"]
    assert (folder / "write_tokens").read_text() != before[folder / "write_tokens"]
    (folder / "database").unlink()
    with pytest.raises(SystemExit, match="has postgres_password, but not database, which has to agree"):
        maker.make(folder)


def _texts(value: Any) -> list[str]:
    """All texts within a value."""
    if isinstance(value, dict):
        return [text for item in value.values() for text in _texts(item)]
    if isinstance(value, list):
        return [text for item in value for text in _texts(item)]
    return [value] if isinstance(value, str) else []


def test_the_image_has_what_bucket_and_database_need() -> None:
    (install,) = [value for name, value in instructions() if name == "RUN" and "bin/pip install" in value]
    assert '"$(echo /wheels/*.whl)[s3,postgres]"' in install
    assert all(service(name)["image"] == service("s3")["image"] for name in ("s3", "bucket"))
    assert "-master.telemetry=false" in service("s3")["command"]


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
    (target,) = collecting["scrape_configs"][1]["static_configs"][0]["targets"]
    assert f"-metricsPort={target.removeprefix('s3:')}" in service("s3")["command"]
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
