"""``rsc-swarm bench``: what this machine does, each figure from a real run and next to what it is to be compared with.

Speed of a flight is given against the bare echo of messages of the same sizes, taken in turn with it, because the
machine's own speed wanders. Medians of the runs are printed; the JSON has every run.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import median
from typing import Any

import numpy as np
import psutil

from agent.policy.learned_kernel import empty_question
from agent.policy.model_file import SHIPPED, read_model
from agent.policy.network import Network
from agent.slot_endpoints import make_endpoint
from protocols.dynamics import TICK_S
from protocols.errors import BrokenError
from protocols.mission.document import Mission
from protocols.slots.seals import Stamps
from protocols.wire.frames import FIXED
from rsc_swarm.bench.batch import bench_batch
from rsc_swarm.bench.echo import bare_echo
from rsc_swarm.errors import NAMED, error_of
from rsc_swarm.flight.in_process import fly
from rsc_swarm.flight.launch import Launched, launch
from rsc_swarm.flight.simulate import Simulation, simulate
from rsc_swarm.machine.leaving import passing_folder

_ECHO_TICKS = 600
_LONE_WORLD = """
import sys, time
from pathlib import Path
from rsc_swarm.flight.key_files import make_login_files
from world.server.link import WorldLink
with WorldLink(make_login_files(Path(sys.argv[2]), "rsc", 1), [sys.argv[1]]):
    print("open", flush=True)
    time.sleep(60)
"""
_LONE_DRONE = """
import sys
from pathlib import Path
print("born", flush=True)
from rsc_swarm.flight.key_files import read_login
from rsc_swarm.flight.alone import fly_agent
endpoint = sys.argv[1]
login = read_login(Path(sys.argv[2]) / "agent-0.json", 0, endpoint, plain_text=False)
fly_agent(login, endpoint, "rsc-h20", lambda seconds: print(seconds, flush=True))
"""
_LARGE, _LARGEST = 100, 250
_CURVE = (25, 100, 256, 1024)  # drones that one process flies
POLICIES = ("rsc-h20", "analytic")


def bench(
    agents: int = 25, quick: bool = False, say: Callable[[str], None] = lambda line: None
) -> dict[str, Any]:
    """All figures, as plain numbers, for ``agents`` drones and for larger swarms; ``say`` is told what is being measured.

    Args:
        quick: of larger swarms fewer seconds are flown, and each but once.

    Raises:
        rsc_swarm.flight.launch.RunBroken, RuntimeError: a run broke.
    """
    say("a launch from the command line, and one drone alone")
    figures: dict[str, Any] = {"agents": agents, **_alone(agents)}
    say("one process: the batch simulation and the slot protocol")
    figures |= {**_batch(agents), **_protocol(agents)}
    say("the batch simulation of training, and VMAS")
    figures |= bench_batch(agents, quick)
    for size, runs in ((agents, 5), (_LARGE, 3), (_LARGEST, 1)):
        say(f"{size} drones in {size} processes, and the bare echo")
        figures[f"flights_{size}"] = _flights(_mission(size, quick), 1 if quick else runs)
    figures["in_one_process"] = {}
    for size in _CURVE:
        say(f"{size} drones in one process")
        figures["in_one_process"][size] = _in_one_process(
            _mission(size, quick) if quick else Mission(agents=size)
        )
    say("the policy's model")
    return figures | _model_call()


def _mission(agents: int, quick: bool) -> Mission:
    """Of the largest swarms only the beginning is flown in processes: the whole takes ten minutes."""
    return Mission(
        agents=agents, fly_s=10.0 if agents > _LARGE else 5.0 if quick and agents == _LARGE else None
    )


def twins(agents: int, count: int, say: Callable[[str], None] = lambda line: None) -> dict[str, int]:
    """Fly maps 0 to ``count - 1`` in real processes and in one process; how many flights succeeded and how many were twins."""
    missions = [Mission(agents=agents, map_seed=seed, seed=1000 * seed) for seed in range(count)]
    flown = []
    for (
        mission
    ) in missions:  # all launches first: a process that has flown a learned policy itself must not fork
        flown.append(launch(mission).whole().outcome)
        say(f"map {mission.map_seed}: {flown[-1].digest}")
    equal = 0
    for mission, outcome in zip(missions, flown, strict=True):
        twin = simulate([mission])[0]
        equal += outcome.digest == twin.digest
        say(
            f"map {mission.map_seed}: {outcome.digest} {'is' if outcome.digest == twin.digest else 'IS NOT'} {twin.digest}"
        )
    succeeded = sum(outcome.success for outcome in flown)
    return {"flights": count, "succeeded": succeeded, "equal_digests": equal}


def render(figures: dict[str, Any]) -> str:
    """The figures as lines for people."""
    flights = [
        f"{f'{size} drones in processes, {policy}':34s} {flown['real_time_factor']:.2f} x real time, "
        f"{100 * flown['share_of_echo']:.0f} % of the bare echo's tick rate, {flown['pss_mb_per_agent']:.1f} MB a drone (PSS)"
        for size in (figures["agents"], _LARGE, _LARGEST)
        for policy, flown in figures[f"flights_{size}"].items()
    ]
    curve = [
        f"{f'{size} drones in one process':34s} {flown['real_time_factor']:.2f} x real time, "
        f"{flown['us_per_agent_tick']:.1f} us per drone and tick"
        for size, flown in figures["in_one_process"].items()
    ]
    default = figures[f"flights_{figures['agents']}"][POLICIES[0]]
    return "\n".join(
        [
            *flights,
            *curve,
            f"{f'{POLICIES[0]} instead of {POLICIES[1]}':34s} costs {100 * _cost(figures):.0f} % of the real-time factor, "
            "pair by pair",
            f"launch to first tick               {figures['first_tick_s']:.2f} s",
            f"a drone alone                      ready in {figures['agent_ready_s']:.2f} s, "
            f"{figures['agent_resident_mb']:.0f} MB resident",
            f"a frame                            {default['median_frame_bytes']:.0f} bytes at the median",
            f"a tick's messages                  {default['bytes_up']:.0f} bytes up, {default['bytes_down']:.0f} down",
            f"a call of {POLICIES[0]}'s model           {figures['model_call_ms']:.3f} ms at the median, one thread",
            f"slot protocol while quiet          {figures['protocol_bytes']} bytes a frame, "
            f"{figures['protocol_us']:.1f} us per drone and tick",
            f"many in one process, in step       {figures['simulated_us_per_agent_tick']:.1f} us per drone and tick",
            f"batch simulation                   {figures['episodes_per_s']:.0f} episodes/s, "
            f"{figures['batch_agent_steps_per_s'] / 1e6:.1f} million agent-steps/s{_beside_vmas(figures)}",
        ]
    )


def _cost(figures: dict[str, Any]) -> float:
    """By what share the learned policy flies slower than the hand-made one: the median over launches flown in turn."""
    learned, made = (
        figures[f"flights_{figures['agents']}"][policy]["real_time_factors"] for policy in POLICIES
    )
    return float(1 - median(slow / fast for slow, fast in zip(learned, made, strict=True)))


def _beside_vmas(figures: dict[str, Any]) -> str:
    vmas = figures["vmas_agent_steps_per_s"]
    if vmas is None:
        return " (VMAS is not installed: pip install vmas==1.5.2)"
    times = figures["batch_agent_steps_per_s"] / vmas
    return f", {times:.0f} times VMAS flocking ({vmas:,.0f}/s)"


def _flights(mission: Mission, runs: int) -> dict[str, dict[str, Any]]:
    """By policy: flights in real processes, in turn with each other and with bare echoes of the same message sizes."""
    flown: dict[str, list[Launched]] = {policy: [] for policy in POLICIES}
    echoes = []
    for run in range(runs):
        for policy, launched in flown.items():
            launched.append(launch(mission.model_copy(update={"policy": policy}), weigh=run == 0))
            up, down = launched[-1].whole().message_bytes
        ticks = _ECHO_TICKS if mission.agents < _LARGE else _ECHO_TICKS // 4
        echoes.append(bare_echo(mission.agents, round(up), round(down), ticks))
    return {policy: _flown(launched, echoes) for policy, launched in flown.items()}


def _in_one_process(mission: Mission) -> dict[str, float]:
    """One flight of drones that share a process."""
    factor = fly(mission).real_time_factor
    return {"real_time_factor": factor, "us_per_agent_tick": 1e6 * TICK_S / factor / mission.agents}


def _flown(launched: list[Launched], echoes: list[float]) -> dict[str, Any]:
    first, factors = launched[0], [one.flown.real_time_factor for one in launched]
    return {
        "real_time_factors": factors,
        "real_time_factor": median(factors),
        "echo_ticks_per_s": echoes,
        "share_of_echo": median(factor / TICK_S / echo for factor, echo in zip(factors, echoes, strict=True)),
        "pss_mb_per_agent": first.pss_mb,
        "median_frame_bytes": first.flown.median_frame_bytes,
        "bytes_up": first.flown.message_bytes[0],
        "bytes_down": first.flown.message_bytes[1],
    }


def _model_call() -> dict[str, Any]:
    """One drone's question to the default policy's model."""
    model = read_model(SHIPPED / f"{POLICIES[0]}.onnx")
    note = model.facts
    asked = empty_question(1, note.past, note.neighbours, note.rounds)
    asked.share[:] = 1.0 / note.neighbours
    plan = Network(note, model.data).bound(asked, *np.zeros((2, 1, note.horizon, 2), np.float32))
    spans = []
    for _ in range(2000):
        began = time.perf_counter_ns()
        plan()
        spans.append(time.perf_counter_ns() - began)
    return {"model_call_ms": median(spans) / 1e6}


def _alone(agents: int) -> dict[str, Any]:
    """The command line from its start: a launch to its first tick, and one drone alone as on its companion computer."""
    with passing_folder("rsc-swarm-bench-") as folder:
        report, endpoint = folder / "report.json", f"unixsock-stream/{folder}/world.sock"
        short = ["--agents", str(agents), "--set", "fly_s=0.5", "--json", str(report)]
        flown = subprocess.run(
            [sys.executable, "-m", "rsc_swarm", "launch", *short],
            env={**os.environ, **NAMED}, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if not report.is_file():
            raise error_of(flown.stderr, flown.returncode)
        first_tick = json.loads(report.read_text())["first_tick_s"]
        with _child(_LONE_WORLD, endpoint, str(folder)), _child(_LONE_DRONE, endpoint, str(folder)) as drone:
            if not (ready := drone.stdout.readline()):
                raise BrokenError("a drone alone did not begin; what it said stands above")
            resident = psutil.Process(drone.pid).memory_info().rss / 1e6
    return {"first_tick_s": first_tick, "agent_ready_s": float(ready), "agent_resident_mb": resident}


@contextmanager
def _child(program: str, *arguments: str) -> Iterator[Any]:
    """A Python process that has printed its first line, killed at the end."""
    with subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # Ctrl-C is for the command, which ends it
    ) as process:
        assert process.stdout is not None
        try:
            process.stdout.readline()
            yield process
        finally:
            process.kill()


def _batch(agents: int) -> dict[str, Any]:
    """Flights in one process, many in step."""
    simulation = Simulation(
        [Mission(agents=agents, policy="analytic", map_seed=seed, seed=seed) for seed in range(6)]
    )
    for _ in range(100):
        simulation.tick()
    began = time.process_time()
    for _ in range(200):
        simulation.tick()
    spent = time.process_time() - began
    return {
        "simulated_us_per_agent_tick": spent
        / 200
        / simulation.world.position.shape[0]
        / simulation.world.position.shape[1]
        * 1e6
    }


def _protocol(agents: int) -> dict[str, Any]:
    """What the slot protocol costs while nothing changes: CPU per agent and tick (four neighbours heard), bytes per frame."""
    party = make_endpoint(Mission(agents=agents), 0, list(range(agents)), 0, Stamps(0))
    note = party.note(0)
    spans = []
    for tick in range(2000):
        began = time.perf_counter_ns()
        for sender in (1, 2, 3, 4):
            party.hear(note, sender, tick)
        party.advance(tick)
        party.note(tick)
        spans.append(time.perf_counter_ns() - began)
    fields = [FIXED[name].itemsize for name in ("loud", "digest", "ages", "age_from")]
    return {"protocol_us": median(spans) / 1e3, "protocol_bytes": sum(fields)}
