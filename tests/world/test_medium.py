"""The medium: the edge of radio range, each rule alone, all rules together, and whose luck it is."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from protocols.mission.document import Mission, parse_mission
from world.medium import chance, medium
from world.order import any_order

Frame = tuple[int, int, int, int]  # sent at, from, to, arrived at


def mission(agents: int = 4, **radio: Any) -> Mission:
    return parse_mission({"agents": agents, "radio": radio, "seed": 11})


def square(agents: int) -> NDArray[np.float64]:
    """All within radio range of each other."""
    return np.stack([np.arange(agents) * 0.1, np.zeros(agents)], axis=1)


class Air:
    """One world of a medium; everyone sends 100 bytes every tick."""

    def __init__(self, task: Mission, position: NDArray[np.float64] | None = None) -> None:
        agents = task.agents
        self.link = medium.link_of(task)
        self.seeds = np.array([task.seed], np.int64)
        self.position = (square(agents) if position is None else np.asarray(position, np.float64))[None]
        self.group = np.zeros((1, agents), np.int16)
        self.loss = np.array([task.radio.loss])
        self.by_x = any_order(1, agents)
        self.fates = np.full((1, agents, agents, len(medium.FATES)), medium.LONG_AGO, np.int32)
        self.alive = np.ones((1, agents), np.bool_)
        self.tally = np.zeros((1, len(medium.TALLY)), np.int64)
        self.bad = np.zeros((1, agents, agents), np.bool_)
        self.queue = medium.empty_queue(1, agents, self.link.longest)
        self.sizes = np.full((1, self.link.longest + 1, agents), 100, np.int64)
        self.start, self.arrived = (
            np.zeros(agents + 1, np.int64),
            np.zeros((self.queue.entry.shape[2], 2), np.int32),
        )
        self.active = np.ones(1, np.bool_)
        self.heard: list[Frame] = []
        self.spells: list[NDArray[np.bool_]] = []
        self.tick = 0

    def air(self) -> medium.Air:
        sent = np.full(self.alive.shape, 100, np.int64)
        return medium.Air(self.alive, self.group, self.loss, self.position, sent, self.fates, self.by_x)

    def fly(self, ticks: int) -> "Air":
        agents = self.alive.shape[1]
        for _ in range(ticks):
            now = np.array([self.tick], np.int64)
            total = medium.deliver(
                now, self.active, self.alive, self.sizes, self.queue, self.tally, self.start, self.arrived
            )
            assert total == self.start[-1]
            for agent in range(agents):
                mine = self.arrived[self.start[agent] : self.start[agent + 1]].tolist()
                assert mine == sorted(mine), "by source, then by tick of sending"
                self.heard += [(sent, source, agent, self.tick) for source, sent in mine]
            medium.relay(
                self.link, medium.Clocks(self.seeds, now, self.active),
                self.air(),
                self.bad, self.queue, self.tally,
            )  # fmt: skip
            self.spells.append(self.bad[0].copy())
            self.tick += 1
        return self

    def count(self, name: str) -> int:
        return int(self.tally[0, medium.TALLY.index(name)])

    def lags(self) -> list[int]:
        return [arrived - sent for sent, _, _, arrived in self.heard]


def within(count: int, of: int, share: float) -> bool:
    """Whether ``count`` of ``of`` is what chance ``share`` gives, within five standard deviations."""
    return abs(count - of * share) <= 5 * math.sqrt(of * share * (1 - share))


def test_a_frame_reaches_everyone_in_range_one_tick_later() -> None:
    air = Air(mission()).fly(2)
    assert air.heard == [
        (0, source, agent, 1) for agent in range(4) for source in range(4) if source != agent
    ]
    assert (air.count("sent"), air.count("sent_bytes"), air.count("delivered_bytes")) == (8, 800, 1200)


@pytest.mark.parametrize(
    ("distance", "heard"), [(6.0, True), (np.nextafter(6.0, 7.0), False), (5.99, True), (6.01, False)]
)
def test_radio_range_ends_at_exactly_six_metres(distance: float, heard: bool) -> None:
    air = Air(mission(2), np.array([[0, 0], [distance, 0]])).fly(2)
    assert bool(air.heard) is heard
    assert air.count("out_of_range") == (0 if heard else 4)


@settings(max_examples=50)
@given(data=st.data())
def test_no_frame_from_beyond_radio_range_is_ever_delivered(data: st.DataObject) -> None:
    metre = st.floats(-12, 12)
    places = np.array(data.draw(st.lists(st.tuples(metre, metre), min_size=6, max_size=6)))
    air = Air(mission(6, jitter_ms=20, duplicate=0.5, reorder=0.3, loss=0.1), places).fly(8)
    for _, source, destination, _ in air.heard:
        assert math.dist(places[source], places[destination]) <= 6.0 + 1e-12


def test_what_counts_is_the_distance_at_the_moment_of_sending() -> None:
    air = Air(mission(2, delay_ms=50), np.array([[0, 0], [5, 0]])).fly(1)
    air.position[0, 1, 0] = 50.0
    air.fly(8)
    assert sorted(air.heard) == [(0, 0, 1, 6), (0, 1, 0, 6)]


def test_independent_loss_takes_its_share_of_every_link() -> None:
    air = Air(mission(3, loss=0.3)).fly(2001)
    offered = 2000 * 6
    assert within(offered - len(air.heard), offered, 0.3)
    for source, destination in ((0, 1), (1, 0), (2, 0)):
        heard = sum(1 for _, a, b, _ in air.heard if (a, b) == (source, destination))
        assert within(2000 - heard, 2000, 0.3)
    under_way = int(air.queue.waiting.sum())
    assert air.count("loss") == 2001 * 6 - len(air.heard) - under_way


def test_loss_of_one_loses_everything_and_loss_of_zero_nothing() -> None:
    assert Air(mission(3, loss=1.0)).fly(50).heard == []
    assert len(Air(mission(3, loss=0.0)).fly(51).heard) == 50 * 6


@pytest.mark.parametrize("mean", [0.3, 0.5, 0.7])
def test_bursts_have_the_mean_share_and_the_mean_length_asked_for(mean: float) -> None:
    air = Air(mission(4, burst={"loss": mean, "length_s": 0.3})).fly(6000)
    bad = np.array(air.spells)[:, ~np.eye(4, dtype=bool)]  # (ticks, links)
    # A spell of 30 ticks makes neighbouring ticks alike: 72 000 draws are worth about 2400.
    assert abs(bad.mean() - mean) < 0.06
    ends = bad[:-1] & ~bad[1:]
    starts = ~bad[:-1] & bad[1:]
    length = bad.sum() / (0.5 * (ends.sum() + starts.sum()))
    assert 25 < length < 35
    offered = 6000 * 12
    assert air.count("burst") == bad.sum()
    assert air.count("burst") + air.count("delivered") + int(air.queue.waiting.sum()) == offered


def test_a_burst_is_a_state_from_the_first_tick_on() -> None:
    first = Air(mission(49, burst={"loss": 0.4})).fly(1).spells[0]
    assert within(int(first.sum()), first.size, 0.4)


@pytest.mark.parametrize(("mean", "length_s"), [(0.99, 0.99), (0.9, 0.09), (0.5, 0.01), (1.0, 0.3)])
def test_bursts_keep_their_mean_where_good_spells_are_as_short_as_can_be(
    mean: float, length_s: float
) -> None:
    link = medium.link_of(mission(4, burst={"loss": mean, "length_s": length_s}))
    assert link.burst_enter / (link.burst_enter + link.burst_leave) == pytest.approx(mean)
    assert 0 <= link.burst_leave <= 1
    assert link.burst_enter == pytest.approx(1)


def test_a_bad_link_is_bad_in_one_direction_only() -> None:
    bad = np.array(Air(mission(2, burst={"loss": 0.5})).fly(4000).spells)
    assert (bad[:, 0, 1] != bad[:, 1, 0]).mean() > 0.3


@pytest.mark.parametrize(("delay_ms", "ticks"), [(0, 1), (10, 2), (20, 3), (24, 3), (26, 4), (500, 51)])
def test_delay_comes_on_top_of_the_one_tick_of_every_hop(delay_ms: float, ticks: int) -> None:
    air = Air(mission(2, delay_ms=delay_ms)).fly(60)
    assert set(air.lags()) == {ticks}
    assert len(air.heard) == 2 * (60 - ticks)


def test_jitter_adds_up_to_its_range_and_uses_all_of_it() -> None:
    lags = Air(mission(3, delay_ms=20, jitter_ms=30)).fly(500).lags()
    # 2 ticks of delay, 0 to 3 of jitter, rounded: the two ends are half as wide.
    shares = [lags.count(ticks) / len(lags) for ticks in (3, 4, 5, 6)]
    assert sum(shares) == pytest.approx(1.0)
    assert shares == pytest.approx([1 / 6, 1 / 3, 1 / 3, 1 / 6], abs=0.05)


def test_a_duplicate_comes_one_to_three_ticks_after_the_first() -> None:
    air = Air(mission(3, duplicate=0.25)).fly(1000)
    copies = {lag: air.lags().count(lag) for lag in sorted(set(air.lags()))}
    assert list(copies) == [1, 2, 3, 4]
    assert within(air.count("doubled"), 6000, 0.25)
    assert min(copies[2], copies[3], copies[4]) > 300
    assert max(air.heard.count(frame) for frame in air.heard[:200]) == 1


def test_reordering_holds_back_its_share_behind_later_frames() -> None:
    air = Air(mission(3, reorder=0.2)).fly(1000)
    held = [lag for lag in air.lags() if lag > 1]
    assert within(air.count("held_back"), 6000, 0.2)
    assert set(held) == {3, 4, 5, 6}
    one_link = [sent for sent, a, b, _ in sorted(air.heard, key=lambda frame: frame[3]) if (a, b) == (0, 1)]
    assert one_link != sorted(one_link), "some frames arrive after later ones"
    assert len(one_link) == len(set(one_link))


def test_those_who_are_parted_do_not_hear_each_other() -> None:
    air = Air(mission(4))
    air.group[0] = [1, 1, 2, 0]
    air.fly(2)
    assert {(source, agent) for _, source, agent, _ in air.heard} == {(0, 1), (1, 0)}
    assert air.count("partition") == 2 * 10


def test_the_first_rule_in_the_order_takes_the_blame() -> None:
    far = np.array([[0, 0], [50, 0], [0, 1], [0, 2]])
    air = Air(mission(4, loss=1.0, burst={"loss": 1.0}), far)
    air.group[0] = [1, 1, 2, 1]
    air.fly(1)
    # Drone 1 is out of range of all; 2 is parted from 0 and 3; between 0 and 3 the burst comes first.
    lost = [air.count(rule) for rule in ("out_of_range", "partition", "burst", "loss")]
    assert lost == [6, 4, 2, 0]
    air.link = air.link._replace(burst_enter=0.0)
    air.bad[:] = False
    air.fly(1)
    assert (air.count("burst"), air.count("loss")) == (2, 2)


def test_a_dead_drone_is_sent_nothing_and_what_was_under_way_to_it_comes_to_nobody() -> None:
    air = Air(mission(2, delay_ms=20)).fly(1)
    air.alive[0, 1] = False
    air.fly(5)
    assert {agent for _, _, agent, _ in air.heard} == {0}
    assert air.count("to_nobody") == 1


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1),
    loss=st.floats(0, 1),
    burst=st.floats(0, 0.96) | st.just(1.0),
    delay=st.just(0.0) | st.floats(5, 50),
    jitter=st.just(0.0) | st.floats(5, 100),
    duplicate=st.floats(0, 1),
    reorder=st.floats(0, 1),
    agents=st.integers(2, 5),
)
def test_every_frame_gets_exactly_one_verdict_and_none_comes_too_late(
    seed: int,
    loss: float,
    burst: float,
    delay: float,
    jitter: float,
    duplicate: float,
    reorder: float,
    agents: int,
) -> None:
    ways = {"loss": loss, "delay_ms": delay, "jitter_ms": jitter, "duplicate": duplicate, "reorder": reorder}
    air = Air(mission(agents, burst={"loss": burst}, **ways).model_copy(update={"seed": seed})).fly(60)
    under_way = int(air.queue.waiting.sum())
    offered = 60 * agents * (agents - 1)
    lost = air.count("burst") + air.count("loss")
    assert air.count("delivered") + under_way == offered - lost + air.count("doubled")
    assert max(air.lags(), default=0) <= air.link.longest


def test_a_frames_luck_does_not_depend_on_who_else_sends() -> None:
    """The draws belong to link and tick, so silence elsewhere changes nothing between two drones."""
    radio = {"loss": 0.3, "jitter_ms": 30, "duplicate": 0.2, "reorder": 0.2, "burst": {"loss": 0.3}}
    all_of_them = Air(mission(5, **radio)).fly(300)
    two = Air(mission(5, **radio))
    two.alive[0, 2:] = False
    two.position[0, 2:] = 1000.0
    two.fly(300)
    pair = [frame for frame in all_of_them.heard if frame[1] < 2 and frame[2] < 2]
    assert sorted(pair) == sorted(frame for frame in two.heard if frame[1] < 2 and frame[2] < 2)
    assert len(pair) > 100


def test_who_looks_on_sees_what_became_of_frames_on_each_link() -> None:
    air = Air(mission(3, loss=0.5, reorder=0.3), np.array([[0, 0], [5, 0], [10, 0]])).fly(40)
    carried, lost, delayed = (air.fates[0, :, :, fate] for fate in medium.FATES)
    assert (air.fates[0, 0, 2] == medium.LONG_AGO).all(), "out of range"
    assert (lost[[0, 1, 1, 2], [1, 0, 2, 1]] > 20).all()
    for source, destination in ((0, 1), (1, 0), (1, 2), (2, 1)):
        lags = {sent: at - sent for sent, a, b, at in air.heard if (a, b) == (source, destination)}
        under_way = range(34, 40)
        assert lags.get(carried[source, destination]) == 1 or carried[source, destination] in under_way
        assert lags.get(delayed[source, destination], 0) > 1 or delayed[source, destination] in under_way
        assert lost[source, destination] not in lags


def test_draws_do_not_depend_on_the_order_in_which_they_are_asked() -> None:
    link = medium.link_of(mission(4, loss=0.5, jitter_ms=50, duplicate=0.5, reorder=0.5))
    questions = [(a, b, tick) for a in range(4) for b in range(4) for tick in range(20)]

    def answers(
        order: list[tuple[int, int, int]],
    ) -> dict[tuple[int, int, int], tuple[int, tuple[int, bool], int]]:
        return {
            (a, b, tick): (
                medium.dropped_by(0.5, 5, a, b, tick, True, False),
                medium.ticks_under_way(link, 5, a, b, tick),
                medium.copy_lag(link, 5, a, b, tick),
            )
            for a, b, tick in order
        }

    assert answers(questions) == answers(questions[::-1])


def test_another_seed_is_another_air() -> None:
    one, two = (Air(mission(3, loss=0.5).model_copy(update={"seed": seed})).fly(50).heard for seed in (1, 2))
    assert one != two


def test_the_rules_draw_from_streams_of_their_own() -> None:
    rules = [chance.BURST, chance.LOSS, chance.JITTER, chance.REORDER, chance.DUPLICATE]
    assert len(set(rules)) == 5
