"""What goes to other machines: compose and Kubernetes files are what their schemas ask for, and call commands that there are."""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import kubernetes_validate
import pytest
import yaml
from typer.main import get_command

from rsc_swarm.cli.commands import loaded
from rsc_swarm.flight.ranges import numbers_in

DEPLOY = Path(__file__).parents[1] / "deploy"
COMPOSE, KUBERNETES = DEPLOY / "compose.yaml", DEPLOY / "kubernetes.yaml"
COMMANDS: dict[str, Any] = get_command(loaded()).commands  # type: ignore[attr-defined]
SETTINGS = dict(
    line.split("=", 1)
    for line in (DEPLOY / "swarm.env").read_text().splitlines()
    if line and not line.startswith("#")
)


def objects(kind: str) -> list[Any]:
    return [each for each in yaml.safe_load_all(KUBERNETES.read_text()) if each["kind"] == kind]


def pod(job: Any) -> Any:
    return job["spec"]["template"]["spec"]


def check_compose(file: Path) -> "subprocess.CompletedProcess[str]":
    schema = ("--builtin-schema", "vendor.compose-spec")
    return subprocess.run(
        [sys.executable, "-m", "check_jsonschema", *schema, str(file)], capture_output=True, text=True
    )


def check_words(words: list[str]) -> None:
    """A command of ours is called with options that it has."""
    options = {option for parameter in COMMANDS[words[0]].params for option in parameter.opts}
    assert {word for word in words if word.startswith("--")} <= options, words


def drones_of(index: int) -> list[str]:
    """What the pod with this index calls."""
    container = pod(objects("Job")[1])["containers"][0]
    script = container["args"][0].replace("exec rsc-swarm", "echo")
    run = subprocess.run(
        [*container["command"], script],
        env={"JOB_COMPLETION_INDEX": str(index)},
        capture_output=True,
        text=True,
        check=True,
    )
    return shlex.split(run.stdout)


def test_the_compose_file_is_one(tmp_path: Path) -> None:
    assert check_compose(COMPOSE).returncode == 0
    wrong = tmp_path / "compose.yaml"
    wrong.write_text(COMPOSE.read_text().replace("mem_limit:", "memory_limit:"))
    assert check_compose(wrong).returncode == 1


def test_kubernetes_takes_every_object() -> None:
    every = list(yaml.safe_load_all(KUBERNETES.read_text()))
    for version in ("1.30", kubernetes_validate.latest_version()):
        for each in every:
            kubernetes_validate.validate(each, version, strict=True)
    every[2]["spec"]["completionMode"] = 2
    with pytest.raises(kubernetes_validate.ValidationError):
        kubernetes_validate.validate(every[2], "1.30", strict=True)


def test_whatever_a_file_takes_from_the_settings_is_in_them() -> None:
    for file in (COMPOSE, *DEPLOY.glob("*.service")):
        named = set(re.findall(r"\$\{?(RSC_\w+)", file.read_text()))
        assert named
        assert named <= set(SETTINGS), file


def test_compose_calls_commands_that_there_are() -> None:
    services = yaml.safe_load(COMPOSE.read_text())["services"]
    called = {
        name: shlex.split(re.sub(r"\$\{(RSC_\w+)[^}]*\}", lambda found: SETTINGS[found[1]], each["command"]))
        for name, each in services.items()
    }
    assert called["drones"][:2] == ["agents", "0-11"]
    for words in called.values():
        check_words(words)


def test_the_pods_of_the_indexed_job_fly_every_drone_of_the_world_once() -> None:
    world, drones = objects("Job")
    words = pod(world)["containers"][0]["args"]
    check_words(words)
    agents = int(words[words.index("--agents") + 1])
    called = [drones_of(index) for index in range(drones["spec"]["completions"])]
    for each in called:
        check_words(each)
    assert [drone for each in called for drone in numbers_in(each[1])] == list(range(agents))
    assert drones["spec"]["parallelism"] == drones["spec"]["completions"], "all must be there at once"
