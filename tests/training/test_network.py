"""The network: two ways in to one set of weights, plans that move as drones do, and nothing that depends on left or right."""

import numpy as np
import pytest
import torch

from agent.observation import WIDE_SIZE
from protocols.dynamics import TICK_S
from rsc_swarm.batch.model_inputs import model_inputs
from rsc_swarm.training.config import make_config
from rsc_swarm.training.flying import continued
from rsc_swarm.training.network import make_network, neighbour_shares
from rsc_swarm.training.plan import Plan
from rsc_swarm.training.replay import Samples, mirrored

KINDS = [
    {},
    {"past": 2, "extra": "none"},
    {"horizon": 1},
    {"output": "raw"},
    {"kind": "stgnn", "horizon": 1, "output": "action"},
    {"aggregation": "hops"},
    {"kind": "stgnn", "horizon": 1, "output": "action", "aggregation": "hops", "past": 2},
]


def swarms(worlds: int = 2, agents: int = 5) -> tuple[np.ndarray, ...]:
    """Random observations of some swarms, as a batch has them; some places without a neighbour."""
    rng = np.random.default_rng(0)
    observation = rng.normal(size=(4, worlds, agents, 18)).astype(np.float32)
    near = rng.integers(-1, agents, size=(4, worlds, agents, 8)).astype(np.int16)
    near[:, 0, 0] = -1  # this drone hears nobody
    target = rng.normal(size=(worlds, agents, 2)).astype(np.float32)
    extra = rng.normal(size=(worlds, agents, WIDE_SIZE)).astype(np.float32)
    return observation, near, target, extra


@pytest.mark.parametrize("fields", KINDS, ids=str)
def test_whole_swarms_and_single_drones_get_the_same_answer(fields):
    config = make_config("default", None, width=16, **fields)
    network = make_network(config).eval()
    observation, near, target, extra = swarms()
    inputs = model_inputs(observation, near, target, extra, config.past)
    local = np.concatenate([target, extra], -1) if config.extra == "wide" else target
    whole = network.graphs(
        torch.from_numpy(observation).transpose(0, 1),
        torch.from_numpy(near).transpose(0, 1),
        torch.from_numpy(local),
    )
    own, heard, share, means = (torch.from_numpy(values) for values in inputs[:4])
    said = (means,) if network.hops else (heard, share)
    single = network.drones(own, said, torch.from_numpy(local).flatten(0, 1))
    torch.testing.assert_close(whole.flatten(0, 1), single, rtol=0, atol=1e-5)


def test_what_is_heard_is_one_tick_old():
    observation, near, target, extra = swarms()
    inputs = model_inputs(observation, near, target, extra)
    neighbour = near[2, 1, 3, 0]
    assert neighbour >= 0
    np.testing.assert_array_equal(inputs.heard[1 * 5 + 3, -1, 0], observation[2, 1, neighbour])
    np.testing.assert_array_equal(inputs.own[1 * 5 + 3, -1], observation[3, 1, 3])


def test_a_mean_passed_on_is_one_tick_and_one_hop_older():
    """Drone 0 hears 1, who hears 2, who hears 3: what each saw comes to 0 one after the other."""
    observation = np.zeros((4, 1, 4, 18), np.float32)
    for tick in range(4):
        observation[tick, 0, :, 0] = 10 * tick + np.arange(4)
    near = np.full((3, 1, 4, 8), -1, np.int16)
    near[:, 0, :3, 0] = [1, 2, 3]
    inputs = model_inputs(observation, near, np.zeros((1, 4, 2)), np.zeros((1, 4, WIDE_SIZE)))
    assert inputs.means[0, :, 0].tolist() == [3, 12, 21]  # three hops first: of tick 0, 1 and 2
    assert inputs.means[2, :, 0].tolist() == [0, 0, 23]  # nobody told drone 3 anything


def test_the_mean_is_over_those_who_are_there():
    near = torch.tensor([[[[1, 2, -1], [-1, -1, -1], [0, -1, -1]]]])
    expected = torch.tensor([[0, 0.5, 0.5], [0, 0, 0], [1, 0, 0]])
    torch.testing.assert_close(neighbour_shares(near)[0, 0], expected)


def test_a_plan_moves_as_drones_do():
    plan = Plan(make_config("default", None))
    displacement, change, acceleration = plan(torch.randn(3, plan.size))
    position, velocity = torch.zeros(3, 2), torch.zeros(3, 2)
    for step in range(20):
        after = velocity + TICK_S * acceleration[:, step]
        position, velocity = position + TICK_S / 2 * (velocity + after), after
        torch.testing.assert_close(displacement[:, step], position)
        torch.testing.assert_close(change[:, step], velocity)
    torch.testing.assert_close(plan.travelled(change), displacement)


def test_a_plan_of_four_knots_is_piecewise_linear():
    plan = Plan(make_config("default", None, horizon=10))
    _, _, acceleration = plan(torch.randn(1, plan.size))
    bends = acceleration[0].diff(n=2, dim=0).abs().max(-1).values > 1e-5
    assert bends.nonzero().flatten().tolist() == [2, 5]


def test_a_plan_goes_on_beyond_its_horizon_with_its_last_acceleration():
    long, short = (Plan(make_config("default", None, horizon=h)) for h in (30, 5))
    steady = torch.tensor([[1.0, -2.0]])
    whole = [values.numpy() for values in long(steady[..., None].expand(1, 2, 4).flatten(1))]
    start = [values.numpy() for values in short(steady[..., None].expand(1, 2, 4).flatten(1))]
    displacement, acceleration = continued(start[0], start[2], 30)
    np.testing.assert_allclose(displacement, whole[0], atol=1e-6)
    np.testing.assert_allclose(acceleration, whole[2], atol=1e-6)


def test_a_mirror_turns_left_into_right_and_twice_is_once_back():
    samples = Samples(
        torch.rand(2, 4, 3, 18), torch.zeros(2), torch.rand(2, 3, 2 + WIDE_SIZE), torch.rand(2, 3, 5, 2)
    )
    flip = torch.tensor([True, False])
    seen = mirrored(samples, flip)
    assert (seen.observation[0, ..., [1, 3, 5, 8, 11, 13, 15, 17]] < 0).all()
    assert (seen.observation[0, ..., [0, 2, 4, 6, 7, 9, 10, 12, 14, 16]] > 0).all()
    assert (seen.local[0] < 0).sum() == 3 * (1 + 4 + (WIDE_SIZE - 12) // 2)
    for back, before in zip(mirrored(seen, flip), samples, strict=True):
        torch.testing.assert_close(back, before)
    torch.testing.assert_close(seen.change[1], samples.change[1])
