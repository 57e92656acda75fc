"""``rsc-swarm bench``: what this machine does, each figure from a real run and next to what it is to be compared with.

Speed of a flight is given against the bare echo of messages of the same sizes, taken in turn with it, because the
machine's own speed wanders. Medians of the runs are printed; the JSON has every run.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

import msgpack
import psutil

from agent.parties import make_party
from protocols.mission import TICK_S, Mission
from protocols.swap import encode
from rsc_swarm.bench_echo import bare_echo
from rsc_swarm.launch import Launched, launch
from rsc_swarm.simulate import Simulation, simulate

_ECHO_TICKS = 600
_LONE_WORLD = """
import sys, time
from pathlib import Path
from world.link import Credentials, WorldLink
credentials = Credentials.fresh("rsc", 1)
credentials.save_login(0, Path(sys.argv[2]))
with WorldLink(credentials, [sys.argv[1]]):
    print("open", flush=True)
    time.sleep(60)
"""
_LONE_DRONE = """
import sys
from pathlib import Path
print("born", flush=True)
from rsc_swarm.launch import fly_agent
fly_agent(0, sys.argv[1], Path(sys.argv[2]), lambda seconds: print(seconds, flush=True))
"""
_LARGE = 100


def bench(
    agents: int = 25, quick: bool = False, say: Callable[[str], None] = lambda line: None
) -> dict[str, Any]:
    """All figures, as plain numbers, for ``agents`` drones and for a swarm of 100; ``say`` is told what is being measured.

    Raises:
        rsc_swarm.launch.RunBroken, RuntimeError: a run broke.
    """
    runs = 1 if quick else 3
    say("a launch from the command line, and one drone alone")
    figures: dict[str, Any] = {"agents": agents, **_alone(agents)}
    say("one process: the batch simulation and the slot protocol")
    figures |= {**_batch(agents), **_protocol(agents)}
    say(f"{agents} drones in {agents} processes, and the bare echo")
    figures |= _flights(Mission(agents=agents), runs)
    say(f"{_LARGE} drones in {_LARGE} processes, and the bare echo")
    large = Mission(agents=_LARGE, time_limit_s=5.0) if quick else Mission(agents=_LARGE)
    figures["large"] = {"agents": _LARGE, **_flights(large, runs)}
    return figures


def twins(agents: int, count: int, say: Callable[[str], None] = lambda line: None) -> dict[str, int]:
    """Fly maps 0 to ``count - 1`` in real processes and in one process; how many flights succeeded and how many were twins."""
    equal = succeeded = 0
    for seed in range(count):
        mission = Mission(agents=agents, map_seed=seed, seed=1000 * seed)
        flown = launch(mission).flown.outcome
        twin = simulate([mission])[0]
        equal += flown.digest == twin.digest
        succeeded += flown.success
        say(f"map {seed}: {flown.digest} {'is' if flown.digest == twin.digest else 'IS NOT'} {twin.digest}")
    return {"flights": count, "succeeded": succeeded, "equal_digests": equal}


def render(figures: dict[str, Any]) -> str:
    """The figures as lines for people."""
    large = figures["large"]
    return "\n".join(
        [
            f"{figures['agents']} drones in processes, lockstep   {figures['real_time_factor']:.2f} x real time, "
            f"{100 * figures['share_of_echo']:.0f} % of the bare echo's tick rate",
            f"{large['agents']} drones in processes, lockstep  {large['real_time_factor']:.2f} x real time, "
            f"{100 * large['share_of_echo']:.0f} % of the bare echo's tick rate",
            f"launch to first tick               {figures['first_tick_s']:.2f} s",
            f"memory of a drone in a launch      {figures['pss_mb_per_agent']:.1f} MB proportional (PSS)",
            f"a drone alone                      ready in {figures['agent_ready_s']:.2f} s, "
            f"{figures['agent_resident_mb']:.0f} MB resident",
            f"a frame                            {figures['median_frame_bytes']:.0f} bytes at the median",
            f"a tick's messages                  {figures['bytes_up']:.0f} bytes up, {figures['bytes_down']:.0f} down",
            f"slot protocol while quiet          {figures['protocol_bytes']} bytes a frame, "
            f"{figures['protocol_us']:.1f} us per drone and tick",
            f"in one process                     {figures['simulated_us_per_agent_tick']:.1f} us per drone and tick",
        ]
    )


def _flights(mission: Mission, runs: int) -> dict[str, Any]:
    """Flights in real processes and bare echoes of the same message sizes, in turn."""
    ticks_per_s, echoes, flights = [], [], list[Launched]()
    for run in range(runs):
        flight = launch(mission, weigh=run == 0)
        flights.append(flight)
        up, down = flight.flown.message_bytes
        echo = bare_echo(
            mission.agents,
            round(up),
            round(down),
            _ECHO_TICKS if mission.agents < _LARGE else _ECHO_TICKS // 4,
        )
        echoes.append(echo)
        ticks_per_s.append(flight.flown.real_time_factor / TICK_S)
    return {
        "ticks_per_s": ticks_per_s,
        "real_time_factor": median(ticks_per_s) * TICK_S,
        "echo_ticks_per_s": echoes,
        "share_of_echo": median(rate / echo for rate, echo in zip(ticks_per_s, echoes, strict=True)),
        "pss_mb_per_agent": flights[0].pss_mb,
        "median_frame_bytes": flights[0].flown.median_frame_bytes,
        "bytes_up": flights[0].flown.message_bytes[0],
        "bytes_down": flights[0].flown.message_bytes[1],
    }


def _alone(agents: int) -> dict[str, Any]:
    """The command line from its start: a launch to its first tick, and one drone alone as on its companion computer."""
    with tempfile.TemporaryDirectory(prefix="rsc-swarm-bench-") as name:
        folder = Path(name)
        report, login, endpoint = (
            folder / "report.json",
            folder / "agent-0.json",
            f"unixsock-stream/{folder}/world.sock",
        )
        short = ["--agents", str(agents), "--set", "time_limit_s=0.5", "--json", str(report)]
        subprocess.run(
            [sys.executable, "-m", "rsc_swarm", "launch", *short], capture_output=True, check=False
        )
        first_tick = json.loads(report.read_text())["first_tick_s"]
        with _child(_LONE_WORLD, endpoint, str(login)), _child(_LONE_DRONE, endpoint, str(login)) as drone:
            ready = float(drone.stdout.readline())
            resident = psutil.Process(drone.pid).memory_info().rss / 1e6
    return {"first_tick_s": first_tick, "agent_ready_s": ready, "agent_resident_mb": resident}


@contextmanager
def _child(program: str, *arguments: str) -> Iterator[Any]:
    """A Python process that has printed its first line, killed at the end."""
    with subprocess.Popen(
        [sys.executable, "-c", program, *arguments], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        try:
            yield process
        finally:
            process.kill()


def _batch(agents: int) -> dict[str, Any]:
    """Flights in one process, many in step."""
    simulation = Simulation([Mission(agents=agents, map_seed=seed, seed=seed) for seed in range(6)])
    for _ in range(100):
        simulation.tick()
    began = time.process_time()
    for _ in range(200):
        simulation.tick()
    spent = time.process_time() - began
    return {"simulated_us_per_agent_tick": spent / 200 / len(simulation.agents.work.me) * 1e6}


def _protocol(agents: int) -> dict[str, Any]:
    """What the slot protocol costs while nothing changes: CPU per agent and tick (four neighbours heard), bytes per frame."""
    party = make_party(Mission(agents=agents), 0, list(range(agents)), 0)
    note = party.note(0)
    spans = []
    for tick in range(2000):
        began = time.perf_counter_ns()
        for sender in (1, 2, 3, 4):
            party.hear(note, sender, tick)
        party.advance(tick)
        party.note(tick)
        spans.append(time.perf_counter_ns() - began)
    # Ages of silence (8 bytes and the first one's number) serve the protocol too.
    return {"protocol_us": median(spans) / 1e3, "protocol_bytes": len(msgpack.packb(encode(note))) + 9}
