"""A drone that has turned: it has its login, joins like any other, and does at every tick what an attack says.

The flight code runs as ever; an attack sees the honest answer before it leaves and decides what is said instead.
"""

from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import Any, NamedTuple

import numpy as np
import zenoh

from agent.process import fly, seals_of
from agent.radio.link import AgentLink, open_client
from protocols.slots.seals import Seals, Stamps
from protocols.wire import keys, messages
from protocols.wire.frames import altered
from protocols.wire.lies import Honest, Lie
from protocols.wire.login import Login
from protocols.wire.messages import Reply, Tick
from rsc_swarm.flight.processes import be_drone
from rsc_swarm.flight.world_process import JOIN_S

LEAVES_S = 30.0  # when the world is silent for so long
_STRANGE = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,  # it would leave a file
}


class Turn(NamedTuple):
    """One tick of an attack.

    swarm, me, agents: who it is, of how many. asked: the Tick. reply: the honest answer to it. say: to the world. open: another
    link with the same login. open_strange: a session with it that is set up as Zenoh's own programs are. random: the same in
    every run of this attack. memory: kept from tick to tick. seals: its own.
    """

    swarm: str
    me: int
    agents: int
    asked: Tick
    reply: Reply
    say: Callable[[bytes], None]
    open: Callable[[], AgentLink]
    open_strange: Callable[[], zenoh.Session]
    random: Random
    memory: dict[str, Any]
    seals: Seals

    def answer(self, **instead: Any) -> None:
        """Answer honestly, but for these parts of the answer."""
        self.say(messages.pack(self.reply._replace(**instead)))

    def answer_frame(self, **instead: bytes) -> None:
        """Answer honestly, but for these parts of the frame: fixed, known, displacement, note."""
        frame = self.reply.frame
        self.answer(frame=None if frame is None else altered(frame, **instead))

    def lie(self, lie: Lie) -> None:
        """Answer honestly, but for a frame that lies."""
        said, tick = self.reply.frame, self.asked.tick
        if said is not None:
            random = np.random.default_rng(self.random.randrange(2**32))
            said = lie(Honest(self.me, self.agents, tick, said, random, self.seals.seal))
        self.answer(frame=said)


Attack = Callable[[Turn], None]


class _Turned:
    """The drone's link, with the attack in it."""

    def __init__(self, link: AgentLink, endpoint: str, login: Login, attack: Attack, seed: int) -> None:
        self._link, self._login, self._attack = link, login, attack
        self._open = lambda: AgentLink(endpoint, login)
        self._open_strange = lambda: open_client(endpoint, login, JOIN_S, _STRANGE)
        self._random, self._memory, self._agents = Random(seed), dict[str, Any](), keys.MAX_AGENTS
        self._seals: Seals = Stamps(login.agent)
        self._asked: Tick | None = None

    def receive(self, timeout_s: float) -> bytes | None:
        data = self._link.receive(timeout_s)
        if data is not None:
            with suppress(messages.MessageError):
                message = messages.unpack_from_world(data)
                if isinstance(message, messages.Welcome):
                    self._agents = len(message.initial_slots)
                    self._seals = seals_of(self._login.seals, self._agents, message.flight)(self._login.agent)
                elif isinstance(message, Tick):
                    self._asked = message
        return data

    def send(self, payload: bytes) -> None:
        message = messages.unpack_from_drone(payload, self._agents)
        if not isinstance(message, Reply) or self._asked is None:
            self._link.send(payload)
            return
        swarm, me = self._login.swarm, self._login.agent
        say, memory, seals = self._link.send, self._memory, self._seals
        self._attack(
            Turn(
                swarm,
                me,
                self._agents,
                self._asked,
                message,
                say,
                self._open,
                self._open_strange,
                self._random,
                memory,
                seals,
            )
        )

    def use_datagrams(self, key: bytes) -> None:
        """It says all down its pipe, where the world must bear it."""

    def cast(self, payload: bytes) -> bool:
        return False


class Insider:
    """The process of the drone that has turned, to be started in place of an honest one (rsc_swarm.flight.launch.launch)."""

    def __init__(self, attack: Attack, seed: int) -> None:
        self._attack, self._seed = attack, seed

    def __call__(self, agent: int, endpoint: str, login: Login, policy: str) -> None:
        """Take part as this drone until the flight is over."""
        leave = be_drone()
        with AgentLink(endpoint, login, JOIN_S) as link:
            turned = _Turned(link, endpoint, login, self._attack, self._seed)
            fly(turned, agent, policy, lambda: leave.asked, LEAVES_S, login.seals)
