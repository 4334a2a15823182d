"""The compose file asks for what the program has."""

import argparse
import os
import re
import subprocess
from ipaddress import ip_address, ip_network
from pathlib import Path

import pytest

from handscope.app import serving
from handscope.app.cli import main
from handscope.app.commands import serve
from handscope.estimators.errors import InputError

ROOT = Path(__file__).parents[3]
yaml = pytest.importorskip("yaml", reason="no YAML reader on this machine")


def test_the_compose_file_starts_the_server_with_options_that_there_are() -> None:
    told = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text())["services"]
    program, verb, *words = told["handscope"]["command"]
    parser = argparse.ArgumentParser()
    serve.add(parser)
    asked = parser.parse_args([re.sub(r"\$\{(\w+)[^}]*\}", r"\1", word) for word in words])
    assert (program, verb, asked.name, asked.metrics) == (
        ".venv/bin/handscope",
        "serve",
        ["HOST_NAME"],
        ("0.0.0.0", 9100),
    )
    assert asked.proxy == [told["proxy"]["networks"]["inside"]["ipv4_address"]]
    example = (ROOT / "deploy" / "env.example").read_text()
    wanted = set(re.findall(r"\$\{(\w+)", (ROOT / "deploy" / "compose.yaml").read_text()))
    assert wanted == set(re.findall(r"^(\w+)=", example, re.M))
    optional = {name for name, value in told["handscope"]["environment"].items() if value is None}
    assert optional == set(re.findall(r"^# (\w+)=", example, re.M))


def test_nobody_is_given_the_address_that_the_proxy_names() -> None:
    """It starts last: Docker gave the first address to the database, and the proxy could not start."""
    told = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text())
    [addresses] = told["networks"]["inside"]["ipam"]["config"]
    proxy = ip_address(told["services"]["proxy"]["networks"]["inside"]["ipv4_address"])
    assert proxy in ip_network(addresses["subnet"])
    assert proxy not in ip_network(addresses["ip_range"])
    more = yaml.safe_load((ROOT / "deploy" / "compose.override.example.yaml").read_text())[
        "services"
    ]["handscope"]
    shared = {*more["networks"], *told["services"]["handscope"]["networks"]} & set(
        told["services"]["proxy"]["networks"]
    )
    assert shared == {"inside"}, (
        "the proxy could come from another address, and what it says of TLS would count for nothing"
    )


def test_a_backup_that_failed_is_tried_again_soon(tmp_path: Path) -> None:
    """The first came before the server had made the schema, and the next a day later."""
    told = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text())["services"]
    script = str(told["backup"]["command"][2]).replace("$$", "$")
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    for name, does in {
        ".venv/bin/handscope": "test -e failed_once || { touch failed_once; exit 2; }",
        "sleep": 'echo "$1" >> slept; test "$1" -lt 86400 || kill "$PPID"',
        "find": "true",
    }.items():
        program = tmp_path / name
        program.write_text(f"#!/bin/sh\n{does}\n")
        program.chmod(0o700)
    path = f"{tmp_path}:{os.environ['PATH']}"
    subprocess.run(["sh", "-c", script], cwd=tmp_path, env={"PATH": path}, timeout=30, check=False)
    assert (tmp_path / "slept").read_text().split() == ["600", "86400"]


def test_every_container_may_write_nothing_but_what_is_named() -> None:
    told = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text())["services"]
    for name, service in told.items():
        assert service["read_only"] and service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert {"mem_limit", "pids_limit"} <= service.keys(), name


def test_the_program_s_files_belong_to_root_in_the_image() -> None:
    lines = (ROOT / "Dockerfile").read_text().splitlines()
    user = lines.index("USER 1000:1000")
    assert not [line for line in lines if line.startswith("COPY --chown")]
    assert [line for line in lines[:user] if line.startswith("RUN make")]
    assert not [line for line in lines[user:] if line.startswith(("RUN", "COPY"))]


def test_images_are_pinned_by_the_digest_that_docker_tells(tmp_path: Path) -> None:
    digest = f"sha256:{'0a' * 32}"
    docker = tmp_path / "docker"
    docker.write_text(f'#!/bin/sh\n[ "$1" = pull ] || echo "${{5%%:*}}@{digest}"\n')
    docker.chmod(0o755)
    settings = tmp_path / "settings"
    settings.write_text((ROOT / "deploy" / "env.example").read_text())
    words = [ROOT / ".ci" / "pin-images", settings]
    path = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    subprocess.run(words, env=path, check=True, capture_output=True)
    pinned = settings.read_text()
    assert re.findall(r"^(\w+)_IMAGE=(\S+)$", pinned, re.M) == [
        (name, f"{image}@{digest}")
        for name, image in [("PYTHON", "python"), ("POSTGRES", "postgres"), ("CADDY", "caddy")]
    ]


def test_every_health_check_says_how_it_is_run() -> None:
    """Docker refuses the whole file otherwise."""
    told = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text())["services"]
    assert [
        service["healthcheck"]["test"][0] for service in told.values() if "healthcheck" in service
    ] == ["CMD", "CMD"]


@pytest.mark.parametrize("lock", ["requirements.lock", "requirements-server.lock"])
def test_the_tests_run_with_the_versions_that_a_clinic_installs(lock: str) -> None:
    installed, tested = _versions(ROOT / lock), _versions(ROOT / "requirements-dev.lock")
    assert {
        package: versions for package, versions in installed.items() if tested[package] != versions
    } == {}


def _versions(lock: Path) -> dict[str, set[str]]:
    """One a package, or several for several Pythons."""
    held: dict[str, set[str]] = {}
    for package, version in re.findall(r"^([\w.-]+)==(\S+)", lock.read_text(), re.M):
        held.setdefault(package, set()).add(version)
    return held


def test_accounts_and_the_trail_are_those_of_the_server_s_database(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The compose file names it in the environment: otherwise an empty database in the data folder would be found in order."""
    monkeypatch.setenv("HANDSCOPE_DATABASE", f"sqlite:///{tmp_path / 'the-server-s.sqlite'}")
    assert main(["account", "add", "mira", "--role", "clinician", "--data", str(tmp_path)]) == 0
    assert main(["audit", "verify", "--data", str(tmp_path)]) == 0
    assert "holds: 1 lines" in capsys.readouterr().out
    assert not (tmp_path / "handscope.sqlite").exists()


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="users have no numbers on this system")
def test_a_user_without_a_name_may_type_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As in a container that is run by any number."""

    def has_no_name() -> str:
        raise KeyError("getpwuid(): uid not found")

    monkeypatch.setattr("getpass.getuser", has_no_name)
    assert main(["account", "add", "mira", "--role", "clinician", "--data", str(tmp_path)]) == 0
    assert main(["audit", "list", "--data", str(tmp_path)]) == 0
    assert f"command line: {os.getuid()}" in capsys.readouterr().out


def test_where_no_database_is_no_trail_holds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["audit", "verify", "--data", str(tmp_path)]) != 0
    assert "has no database" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_provider_s_words_for_roles_come_from_the_environment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HANDSCOPE_OIDC_ROLES", "hand-therapists=clinician movement-lab=scientist")
    parser = argparse.ArgumentParser()
    serve.add(parser)
    agreed = serving.sign_on(parser.parse_args(["--oidc-issuer", "https://login.test"]))
    assert agreed is not None
    assert agreed.roles == {"hand-therapists": "clinician", "movement-lab": "scientist"}


@pytest.mark.parametrize(
    "words",
    [
        ["--oidc-issuer", "http://login.test"],
        ["--oidc-issuer", "https://login.test", "--oidc-scope", "profile"],
    ],
)
def test_single_sign_on_that_could_not_be_trusted_is_refused_at_the_start(words: list[str]) -> None:
    parser = argparse.ArgumentParser()
    serve.add(parser)
    with pytest.raises(InputError, match="--oidc-"):
        serving.sign_on(parser.parse_args(words))
