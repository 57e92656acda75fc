"""The air between the drones: a Zenoh peer for each drone and for the operator, linked by the addresses of the fleet file.

Beacons go as best effort in datagrams, so that none ever waits behind one that was lost. No scouting, no multicast, no router:
who is not in the fleet file is not found. The time at which something arrives is taken in the thread that brings it.

Who says more than anybody has to say fills no queue but its own, where the newest counts; most of it Zenoh drops before it costs
anything. Who has keys can declare nothing but to hear what there is.
"""

import itertools
import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import zenoh

from agent.air.clock import Utc
from agent.air.listening import check_free
from protocols.closing import Closing
from protocols.fleet.document import Fleet, places_of
from protocols.wire.account import MAX_ACCOUNT_BYTES
from protocols.wire.keys import LinkError, checked_agent, checked_swarm, user
from protocols.wire.login import Certificates
from protocols.wire.nature import WORLD, to_drone
from protocols.wire.transport import AGENT_RUNTIME, few_threads, filled, leave, secret

# What each protocol must be told to send best effort in datagrams; tests.scenarios.links measures what comes of it.
_DATAGRAMS = {"udp": "?rel=1;mixed_rel=1", "quic": "?mixed_rel=1"}
# A link that is silent for so long is made anew. QUIC left alone tries again at times that double: who was cut off for 3 s was
# heard up to 6.2 s after the cut's end; by a new link, tried for at short intervals, after 0.8 s (tests.scenarios.links).
_LEASE_MS = _OPEN_MS = 1500
# Who is linked at one of another's places is turned away at the others, and tries again: that must not be often.
_RETRY_MS = 100, 2000
_LEAVE_S = 0.5  # over a bad network, farewells may not come through
# Of each kind from each; what came before the newest is of no use any more.
_MOST_WAITING = 64
# Of each kind over each link; ten times as much as anybody has to say. Of what comes all at once the first is heard.
_MOST_HZ = 1000.0
OPERATOR = "ground"
Key = tuple[str, str]  #: by whom, and of which kind
_WORD: Key = (OPERATOR, "word")


class Said(NamedTuple):
    """By whom: a drone's number, `OPERATOR` or the world. kind: beacon, account, word, or protocols.wire.nature's.
    at_us: UTC on arrival.
    """

    who: str
    kind: str
    data: bytes
    at_us: int


class End(NamedTuple):
    """One end of the air: ``who`` listens at ``listen``, looks for others at ``connect``, and hears this of whom."""

    who: str
    listen: str
    connect: Sequence[str] = ()
    hears: Sequence[Key] = ()


def end_of(fleet: Fleet, who: str) -> End:
    """The end of a drone, of the operator, or of the world of a fleet.

    All are linked to the operator. Drones are linked to each other, or, in mixed reality, to the world alone, which hears them
    and says to each what reaches it. Of two who are to be linked each looks for the other, for a listener may be held up
    (protocols.fleet.document.places_of).
    """
    ground, world = fleet.ground_address, fleet.world_address
    drones = {me: fleet.address(me) for me in range(len(fleet.drones))}
    if who == OPERATOR:
        return End(
            who, ground, [*drones.values(), *([world] if world else [])], _of(drones, "beacon", "account")
        )
    if who == WORLD:
        assert world
        hears = [*_of(drones, "beacon", "pose", "status"), _WORD]
        return End(who, world, [ground, *drones.values()], hears)
    me = int(who)
    mine = drones.pop(me)
    if world:
        return End(who, mine, [ground, world], [_WORD, *_of_world(me)])
    return End(who, mine, [ground, *drones.values()], [_WORD, *_of(drones, "beacon")])


def _of(drones: Iterable[int], *kinds: str) -> list[Key]:
    return [(name_of(drone), kind) for drone in drones for kind in kinds]


def _of_world(drone: int) -> list[Key]:
    return [(WORLD, to_drone(what, drone)) for what in ("carried", "nature")]


class AirLink(Closing):
    """One who speaks on the air, and hears all others."""

    def __init__(
        self,
        swarm: str,
        end: End,
        certificates: Certificates | None = None,
        drones: int = 0,
        clock: Utc | None = None,
    ) -> None:
        """``end`` listens and looks for others in the background.

        Args:
            certificates: its own. Then nobody is linked who has none of the same authority, and each of ``drones`` and the
                operator is heard only in the name that its certificate has.
            clock: by which it is told when something came.

        Raises:
            LinkError: it cannot listen there.
        """
        self._swarm, self._who, self._clock = checked_swarm(swarm), end.who, clock or Utc()
        self._order = itertools.count()
        self._heard: list[deque[tuple[int, Said]]] = []
        check_free(end.listen)
        try:
            settings = _settings(swarm, end)
            if certificates:
                settings |= secret(certificates, "listen", "connect")
                settings["access_control"] = _access(swarm, drones)
            with few_threads(AGENT_RUNTIME):
                self._session = zenoh.open(filled(zenoh.Config(), settings))
        except zenoh.ZError as error:
            raise LinkError(
                f"cannot listen at {end.listen} ({str(error)[:120]}); give a free port of this machine, "
                "or end what uses it"
            ) from None
        self._publishers: dict[str, Any] = {}
        try:
            for who, kind in end.hears:
                take = zenoh.handlers.Callback(self._taking(who, kind), indirect=False)
                self._session.declare_subscriber(_key(self._swarm, who, kind), take)
        except BaseException:
            self.close()
            raise

    def _publisher(self, kind: str) -> Any:
        return self._session.declare_publisher(
            _key(self._swarm, self._who, kind),
            express=True,
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=zenoh.Reliability.BEST_EFFORT,
        )

    def _taking(self, who: str, kind: str) -> Callable[[zenoh.Sample], None]:
        waiting: deque[tuple[int, Said]] = deque(maxlen=_MOST_WAITING)
        self._heard.append(waiting)

        def take(sample: zenoh.Sample) -> None:
            said = Said(who, kind, sample.payload.to_bytes(), self._clock.us())
            waiting.append((next(self._order), said))

        return take

    def say(self, kind: str, data: bytes) -> None:
        """To all that are linked."""
        publisher = self._publishers.get(kind)
        if publisher is None:
            publisher = self._publishers[kind] = self._publisher(kind)
        publisher.put(data)

    def hear(self) -> list[Said]:
        """What came since, oldest first."""
        heard: list[tuple[int, Said]] = []
        for waiting in self._heard:
            heard += [waiting.popleft() for _ in range(len(waiting))]
        return [said for _, said in sorted(heard)]

    def close(self) -> None:
        # No daemon: where farewells still wait for an answer, the process has to end without taking Python down around Zenoh's
        # threads (rsc_swarm.cli.main), or one of them aborts it.
        leaving = threading.Thread(target=leave, args=[self._session])
        leaving.start()
        leaving.join(_LEAVE_S)


def name_of(drone: int) -> str:
    """What a drone is called on the air."""
    return str(checked_agent(drone))


def drone_of(name: str) -> int:
    """Which drone is called so.

    Raises:
        ValueError: none is.
    """
    return checked_agent(int(name))


def _key(swarm: str, who: str, kind: str) -> str:
    return f"{swarm}/air/{who}/{kind}"


def _settings(swarm: str, end: End) -> dict[str, Any]:
    kinds = sorted({kind for _, kind in end.hears})
    slower = [{"key_expr": _key(swarm, "*", kind), "freq": _MOST_HZ} for kind in kinds]
    return {
        "mode": "peer",
        "listen/endpoints": [_endpoint(place) for place in places_of(end.listen)],
        "listen/exit_on_failure": True,
        "connect/endpoints": [_endpoint(place) for each in end.connect for place in places_of(each)],
        "connect/timeout_ms": -1,  # whoever is not there yet is looked for again and again
        "connect/exit_on_failure": False,
        "connect/retry": {
            "period_init_ms": _RETRY_MS[0],
            "period_max_ms": _RETRY_MS[1],
            "period_increase_factor": 2.0,
        },
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "timestamping/enabled": False,
        "transport/unicast/open_timeout": _OPEN_MS,
        "transport/link/tx/lease": _LEASE_MS,
        "transport/shared_memory/enabled": False,
        # Nothing longer is said; left alone, Zenoh would join fragments up to a gigabyte.
        "transport/link/rx/max_message_size": 2 * MAX_ACCOUNT_BYTES,
        "downsampling": [{"id": "most", "flows": ["ingress"], "messages": ["put"], "rules": slower}]
        if slower
        else [],
    }


def _endpoint(address: str) -> str:
    return address + _DATAGRAMS.get(address.partition("/")[0], "")


def _access(swarm: str, drones: int) -> dict[str, Any]:
    """Everybody may hear everybody; in the name of each may speak who has its certificate."""
    everything = f"{swarm}/air/**"
    names = {name_of(drone): user(drone) for drone in range(drones)} | {OPERATOR: OPERATOR, WORLD: WORLD}
    said = [_WORD, *_of(range(drones), "beacon", "account", "pose", "status")]
    said += [key for drone in range(drones) for key in _of_world(drone)]
    hearing: list[dict[str, Any]] = [
        {
            "id": "say",
            "flows": ["egress"],
            "messages": ["put", "declare_subscriber"],
            "key_exprs": [everything],
        },
        # Each in so many words: what was declared, Zenoh keeps.
        {
            "id": "hear",
            "flows": ["ingress"],
            "messages": ["declare_subscriber"],
            "key_exprs": [_key(swarm, *key) for key in said],
        },
    ]
    speaking = [
        {"id": who, "flows": ["ingress"], "messages": ["put"], "key_exprs": [_key(swarm, who, "*")]}
        for who in names
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [{"permission": "allow", **rule} for rule in hearing + speaking],
        "subjects": [{"id": who, "cert_common_names": [name]} for who, name in names.items()],
        "policies": [{"rules": ["say", "hear", who], "subjects": [who]} for who in names],
    }
