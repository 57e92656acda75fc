"""Mixed reality, at the drone's end: the world that carries what others say and shows obstacles which only it knows. Pure."""

from collections.abc import Sequence

from agent.air.obstacles import Sighting
from protocols.fleet.plan import Plan
from protocols.wire.heard import unpack_heard
from protocols.wire.nature import Nature, unpack_nature

_HEARD_S = 0.5


class NatureHeard:
    """What a drone of ``plan`` hears of its world: a source of obstacles (agent.air.obstacles)."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._nature: Nature | None = None
        self._heard_at = 0.0
        self._news: list[Sighting] = []

    @property
    def _agrees(self) -> bool:
        nature, plan = self._nature, self._plan
        return nature is not None and (nature.fleet, nature.mission) == (
            plan.fleet_digest,
            plan.mission_digest,
        )

    def hear(self, data: bytes, now: float) -> None:
        """The world shows itself. Of another fleet's world nothing is believed.

        Raises:
            protocols.wire.nature.NatureError: it says nothing that can be read.
        """
        self._nature, self._heard_at = unpack_nature(data), now
        if self._agrees:
            self._news += [Sighting(*disc, self._nature.sigma_m) for disc in self._nature.seen]

    def carried(self, data: bytes) -> list[tuple[int, bytes]]:
        """The beacons that the world brings, and who said them."""
        return list(unpack_heard(data, self._plan.mission.agents)) if self._agrees else []

    def news(self) -> Sequence[Sighting]:
        news, self._news = self._news, []
        return news

    def complaint(self, now: float) -> str | None:
        """What speaks against flying in it."""
        if self._nature is None or now - self._heard_at > _HEARD_S:
            return f"it does not hear the world at {self._plan.fleet.world_address}; start it, or leave world out"
        return None if self._agrees else "its world has another fleet file or mission; give both the same"
