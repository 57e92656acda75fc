"""What a vehicle is told, as numbered orders (protocols.wire.vehicles): what all vehicles share that are led by orders."""

from abc import ABC, abstractmethod

from protocols.wire.vehicles import Kind, Order, Vector

_NUMBERS = 2**32
_NOWHERE = (0.0, 0.0, 0.0)


class Ordered(ABC):
    """The orders of agent.air.vehicle.Vehicle. One that is given again is the same one; after `kill` there is no other."""

    _order = Order(Kind.NOTHING, 0)

    @abstractmethod
    def _give(self, order: Order) -> None:
        """Send this one, and make it ``_order``."""

    def _next(
        self, kind: Kind, p: Vector = _NOWHERE, v: Vector = _NOWHERE, a: Vector = _NOWHERE, yaw: float = 0.0
    ) -> Order:
        return Order(kind, (self._order.number + 1) % _NUMBERS, p, v, a, yaw)

    def _tell(self, kind: Kind, p: Vector = _NOWHERE) -> None:
        if self._order.kind is not Kind.KILL and (kind, p) != (self._order.kind, self._order.p):
            self._give(self._next(kind, p))

    def arm(self) -> None:
        self._tell(Kind.ARM)

    def take_off(self, height: float) -> None:
        self._tell(Kind.TAKE_OFF, (0.0, 0.0, height))

    def hold(self) -> None:
        self._tell(Kind.HOLD)

    def land(self) -> None:
        self._tell(Kind.LAND)

    def kill(self) -> None:
        self._tell(Kind.KILL)
