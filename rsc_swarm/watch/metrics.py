"""The newest moment of a flight as Prometheus reads it."""

from collections.abc import Callable, Iterator

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.metrics_core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from protocols.dynamics import TICK_S
from world.outlets.picture import COLUMNS, FLYING, FROZEN, LOST, Picture

_STATES = {FLYING: "flying", FROZEN: "frozen", LOST: "lost"}


class _Flight(Collector):
    def __init__(self, newest: Callable[[], Picture | None], pages: Callable[[], int]) -> None:
        self._newest, self._pages = newest, pages

    def collect(self) -> Iterator[Metric]:
        yield GaugeMetricFamily("rsc_swarm_pages", "Pages that look on.", self._pages())
        now = self._newest()
        if now is None:
            return
        column = {name: now.drones[:, place] for place, name in enumerate(COLUMNS)}
        flies = column["state"] != LOST
        yield GaugeMetricFamily(
            "rsc_swarm_time_seconds", "How long the flight has lasted.", now.tick * TICK_S
        )
        yield GaugeMetricFamily("rsc_swarm_real_time_factor", "Its seconds per second.", now.real_time_factor)
        drones = GaugeMetricFamily("rsc_swarm_drones", "Drones by what they do.", labels=["state"])
        for state, name in _STATES.items():
            drones.add_metric([name], int((column["state"] == state).sum()))
        yield drones
        yield GaugeMetricFamily(
            "rsc_swarm_edge_error_ratio", "The worst error of an edge of the formation, of its length.",
            float(column["edge_error"][flies].max(initial=0.0)),
        )  # fmt: skip
        yield GaugeMetricFamily(
            "rsc_swarm_nearest_meters", "The least distance of a drone from anything, m.",
            float(column["nearest_m"][flies].min(initial=float("inf"))),
        )  # fmt: skip
        for name, text, counts in (
            ("frames", "Frames, by what became of them, and their bytes.", now.frames),
            ("swaps", "Swaps of slots, by how far they came.", now.swaps),
        ):
            family = CounterMetricFamily(f"rsc_swarm_{name}", text, labels=["what"])
            for what, count in counts.items():
                family.add_metric([what], count)
            yield family


def metrics(newest: Callable[[], Picture | None], pages: Callable[[], int]) -> Callable[[], bytes]:
    """What makes the text of ``/metrics``. newest: the last picture; pages: how many look on."""
    registry = CollectorRegistry()
    registry.register(_Flight(newest, pages))
    return lambda: generate_latest(registry)
