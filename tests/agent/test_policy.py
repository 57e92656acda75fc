"""Policies: found by name, by entry point or by address, and one line for what cannot be found."""

from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest

from agent.policy import PolicyError, base, find_policy, policy_names
from agent.policy.analytic import Analytic
from agent.policy.cruise import Cruise
from agent.policy.model_file import shipped_models
from protocols.mission.document import Mission, parse_mission
from rsc_swarm.flight.simulate import Simulation, simulate
from tests.agent.example_policy import Homing

MISSION = parse_mission({"agents": 6})


def refusal(name: str) -> str:
    with pytest.raises(PolicyError) as caught:
        find_policy(name, MISSION)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def install(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    """As if a package with this entry point were installed."""
    points = [EntryPoint(name, value, base.ENTRY_POINTS)]
    monkeypatch.setattr(base, "entry_points", lambda group: points if group == base.ENTRY_POINTS else [])


def test_built_in_policies_are_known_by_name() -> None:
    assert {"analytic", "cruise", "saber"} <= set(policy_names())
    assert isinstance(find_policy("analytic", MISSION), Analytic)
    assert isinstance(find_policy("cruise", MISSION), Cruise)


def test_a_policy_is_found_by_its_address() -> None:
    policy = find_policy("tests.agent.example_policy:Homing", MISSION)
    assert isinstance(policy, Homing)
    assert policy.limit == 10.0, "it was made for the mission"


def test_an_installed_policy_is_found_by_its_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, "homing", "tests.agent.example_policy:Homing")
    assert "homing" in policy_names()
    assert isinstance(find_policy("homing", MISSION), Homing)


def test_an_unknown_policy_is_refused_with_those_that_are_known(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, "homing", "tests.agent.example_policy:Homing")
    known = ", ".join(sorted(["analytic", "cruise", "saber", "homing", *shipped_models()]))
    assert refusal("anlytic") == (
        f"policy: unknown policy 'anlytic'; known: {known}; or give package.module:Class or a model file"
    )


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("no.such.module:Class", "cannot be loaded (No module named 'no')"),
        (
            "tests.agent.example_policy:Nobody",
            "cannot be loaded (module 'tests.agent.example_policy' has no attribute",
        ),
        ("tests.agent.example_policy:Mute", "has no method act(seen)"),
        (
            "tests.agent.example_policy:Choosy",
            "could not be made for this mission (made for 9 agents, not 6)",
        ),
        (":Homing", "could not be made for this mission"),
    ],
)
def test_a_policy_that_cannot_be_had_says_why(name: str, why: str) -> None:
    text = refusal(name)
    assert text.startswith(f"policy: '{name}' ")
    assert why in text


def task(policy: str, **fields: Any) -> Mission:
    return parse_mission({"agents": 6, "policy": policy, "obstacles": {"discs": []}, **fields})


@pytest.mark.parametrize("policy", ["analytic", "cruise", "saber", "tests.agent.example_policy:Homing"])
def test_a_swarm_flies_a_whole_flight_by_any_of_them(policy: str) -> None:
    outcome = simulate([task(policy)])[0]
    assert outcome.success, outcome


def test_a_users_policy_decides_the_flight() -> None:
    assert (
        simulate([task("cruise")])[0].digest
        != simulate([task("tests.agent.example_policy:Homing")])[0].digest
    )


@pytest.mark.parametrize("filtered", [True, False])
def test_a_policy_that_wants_nonsense_is_not_followed(filtered: bool) -> None:
    # Far apart, so that the safety filter has nothing to say.
    fields = {"start": {"radius_m": 0}, "safety_filter": filtered, "time_limit_s": 0.3}
    simulation = Simulation([task("tests.agent.example_policy:Nonsense", **fields)])
    start = simulation.world.position.copy()
    while simulation.world.active.any():
        simulation.tick()
    assert np.array_equal(simulation.world.position, start)
