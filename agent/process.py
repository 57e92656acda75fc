"""A drone: what it does each tick with the body, the radio and the clock it was given. A thin shell around AgentCore."""

from collections.abc import Callable

import numpy as np

from agent.body.relayed import Ending, Link, RelayedWorld, WorldClock
from agent.core import AgentCore, Inputs
from agent.ports import Body, Clock, Radio
from agent.quick_ticks import QuickTicks, account_of
from agent.radio.air import Air
from agent.radio.hearing import Hearing
from agent.slot_endpoints import SealsOf
from protocols.kernels import release_memory
from protocols.mission.document import Mission, parse_briefing
from protocols.slots.history import is_permutation
from protocols.slots.seals import Stamps
from protocols.wire import messages
from protocols.wire.keys import LinkError
from protocols.wire.login import SealKeys
from protocols.wire.sensed import SensedPacker, empty_sensed
from protocols.wire.status import AgentStatus, is_due


class Drone:
    """One drone, wherever it flies."""

    def __init__(
        self,
        mission: Mission,
        me: int,
        initial_slots: bytes,
        boot: int,
        body: Body,
        radio: Radio,
        rehearsal: bool = False,
        seals_of: SealsOf = Stamps,
    ) -> None:
        """Drone ``me`` of a swarm that starts in ``initial_slots``, one byte per drone; ``boot``: how often it was restarted;
        ``seals_of``: as agent.core.AgentCore.

        Raises:
            agent.policy.PolicyError: the mission's policy cannot be found or made.
        """
        initial = np.frombuffer(initial_slots, np.uint8).astype(np.int16)[None]
        self._core = AgentCore(mission, [me], initial, boot, rehearsal, seals_of)
        self._body, self._radio = body, radio
        self._air = Air(mission.swarm, mission.agents, messages.MAX_HEARD + 1)
        self._hearing = Hearing(self._air, me, mission.agents)
        self._start = np.zeros(2, np.int64)
        self._believed = self._start[1:].data  # how many frames
        self._inputs = Inputs(
            np.ones(1, np.bool_), body.sensed, self._air, self._start, self._hearing.believed
        )
        self._quick: QuickTicks | None = None
        self._tell_plan: Callable[[bytes], None] | None = None
        self._tick = -1

    @property
    def tick(self) -> int:
        """The last that was flown."""
        return max(self._tick, self._quick.last if self._quick else -1)

    @property
    def rejected(self) -> dict[str, int]:
        """Frames heard and not believed so far, by reason."""
        return self._hearing.rejected

    def act(self, tick: int) -> None:
        """One tick: sense and hear, decide, fly and speak."""
        own = messages.MAX_HEARD
        self._body.sense()
        self._believed[0] = self._hearing.hear(tick, self._radio.hear())
        said = self._core.tick(tick, self._inputs, own)
        if self._quick:
            self._quick.flown(tick)
        self._tick = tick
        self._body.fly(*said.command[0].tolist())
        if said.sent[0]:
            self._radio.say(self._air.pack(own))
        self._radio.report(int(said.slot[0]), self.status() if is_due(tick, bool(said.changed)) else None)
        if self._tell_plan:
            self._tell_plan(self._core.plan_of(tick))

    def open(self) -> None:
        """Open what the policy needs, which takes a moment; else the first tick does it."""
        self._core.open()

    def answer_quickly(self, world: RelayedWorld) -> Callable[[bytes], bytes | None]:
        """What answers Ticks of a relayed world in one compiled call, wherever nothing rare happens (agent.quick)."""
        self._quick = QuickTicks(self._core, self._hearing, world)
        return self._quick.answer

    def tell_plans(self, world: RelayedWorld) -> None:
        """From now on let this world know what is planned; where Ticks are answered quickly, too."""
        self._tell_plan = world.tell_plan
        if self._quick:
            self._quick.telling[0] = True

    def fly(self, clock: Clock) -> None:
        """Act at every tick until the flight is over."""
        self.open()
        for tick in clock.ticks():
            self.act(tick)

    def status(self) -> AgentStatus:
        """The drone's account of itself."""
        return account_of(self._core, self._hearing, self.tick)


def rehearse(mission: Mission) -> None:
    """Load (or on the very first run compile) every kernel a drone needs, so that its first tick is not late."""
    world = RelayedWorld(0)
    drone = Drone(mission, 0, bytes(range(mission.agents)), 0, world, world, rehearsal=True)
    drone.tell_plans(world)
    quick, sensed = drone.answer_quickly(world), SensedPacker(empty_sensed(1)).pack(0)
    for tick in range(3):
        heard = [b"no frame"] if tick == 0 else []  # to load what hears, too
        asked = messages.make_tick(tick, 0, tick - 1, sensed, [0] * len(heard), heard)
        if quick(asked.data) is None:
            world.take(asked)
            drone.act(tick)
    release_memory()


def seals_of(keys: SealKeys | None, agents: int, flight: bytes) -> SealsOf:
    """What a drone with these keys seals its swaps with in a flight, and checks those of others with.

    Raises:
        LinkError: these are the keys of a smaller swarm.
    """
    if keys is None:
        return Stamps
    if len(keys.public_keys) < agents:
        raise LinkError(
            f"a login of a swarm of {len(keys.public_keys)} drones, not of {agents}: use this swarm's own"
        )
    from protocols.slots.signatures import Signatures  # not needed, nor loaded, in a simulation

    public = [bytes.fromhex(key) for key in keys.public_keys[:agents]]
    signatures = Signatures(bytes.fromhex(keys.private_key), public, flight)
    return lambda agent: signatures


def _check_welcome(initial_slots: bytes, agents: int, agent: int) -> None:
    """Raises LinkError if a world welcomes drone ``agent`` to no swarm of its kind."""
    if agent >= agents or len(initial_slots) != agents or not is_permutation(list(initial_slots)):
        raise LinkError(
            f"the world welcomes drone {agent} to a swarm of {agents} drones with {len(initial_slots)} places; "
            "let it be of the same version, and fly a mission that this drone is in"
        )


def fly(
    link: Link,
    agent: int,
    policy: str,
    leaving: Callable[[], bool],
    silence_s: float = messages.SILENCE_LIMIT_S,
    seals: SealKeys | None = None,
) -> Ending:
    """Take part in a flight in a relayed world as drone ``agent`` until it is over; return why it ended.

    Args:
        policy: what it flies. That is decided here and never by the world, so no network chooses what code runs.
        silence_s: leave when the world has said nothing for this long. Counted in this process's own running time: a pause of it
            is no silence of the world.
        seals: this drone's. Without, it believes what anybody says of the swaps of others.

    Raises:
        protocols.wire.keys.LinkError: the world refuses this process.
        protocols.mission.document.MissionError, agent.policy.PolicyError: the mission cannot be flown by this version.
    """
    clock = WorldClock(link, leaving, silence_s)
    welcome = clock.join()
    if welcome is not None:
        mission = parse_briefing(welcome.briefing, policy)
        _check_welcome(welcome.initial_slots, mission.agents, agent)
        own, world = seals_of(seals, mission.agents, welcome.flight), clock.world
        drone = Drone(mission, agent, welcome.initial_slots, welcome.boot, world, world, seals_of=own)
        clock.quick = drone.answer_quickly(world)
        if welcome.watched:
            drone.tell_plans(world)
        drone.fly(clock)
        clock.leave(drone.status())
    assert clock.ending is not None
    return clock.ending
