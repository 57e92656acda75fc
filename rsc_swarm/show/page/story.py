"""The story of a flight in plain words: what was to be flown, and what happened, with what belongs together told together."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from protocols.mission.formation import default_shape
from rsc_swarm.flight.events import BEFALLING, Event
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.flight.words import agents_text, numbers_text

_TOGETHER_S = 2.0  # what is of one kind and no farther apart is one paragraph
_GROUPED = ("swap", "takeover", "move", "detour", *BEFALLING)
_MOST_NAMED = 6


@dataclass(frozen=True)
class Paragraph:
    """Something that happened: when, of which kind, as a sentence, and why. events: their places among all."""

    time_s: float
    what: str
    text: str
    why: str
    events: tuple[int, ...]


def opening(recorded: Recorded) -> str:
    """What was to be flown."""
    mission, path = recorded.mission, recorded.path
    who = "One drone takes off" if mission.agents == 1 else f"{mission.agents} drones take off"
    shape = f" {_formation(mission)}" if mission.agents > 1 else ""
    discs = len(path.obstacles)
    field = "an empty field" if not discs else f"a field with {discs} obstacle{'' if discs == 1 else 's'}"
    text = (
        f"{who}, to fly{shape} through {field} beyond the goal line at x = {path.goal_x:.1f} m, "
        f"within {mission.ticks * TICK_S:g} s."
    )
    return f"{text} {_radio(mission)}" if mission.agents > 1 else text


def _formation(mission: Mission) -> str:
    shape = mission.formation.shape
    names = {"square": "a square", "triangle": "a hollow triangle", "vee": "a V", "line": "a line"}
    name = names.get(default_shape(mission.agents) if shape == "auto" else shape, "a formation of its own")
    return f"in {name}, neighbours {mission.formation.spacing_m:g} m apart,"


def _radio(mission: Mission) -> str:
    radio = mission.radio
    lost = 1 - (1 - radio.loss) * (1 - radio.burst.loss)
    loss = f"{100 * lost:.0f} % of the frames are lost on the way" if lost else "no frame is lost by chance"
    return f"Each hears only drones within {radio.range_m:g} m, and {loss}."


def story(events: Sequence[Event]) -> list[Paragraph]:
    """What happened, in order; the start and the end are told elsewhere."""
    told = [(place, event) for place, event in enumerate(events) if event.what not in ("start", "end")]
    success = any(event.what == "success" for event in events)
    return [_paragraph(group) for group in _groups(told) if not (success and _same_as_success(group, events))]


def _same_as_success(group: list[tuple[int, Event]], events: Sequence[Event]) -> bool:
    event = group[0][1]
    return event.what == "formed" and any(
        other.what == "success" and other.tick == event.tick for other in events
    )


def _groups(told: Sequence[tuple[int, Event]]) -> Iterator[list[tuple[int, Event]]]:
    group: list[tuple[int, Event]] = []
    for place, event in told:
        if group:
            last = group[-1][1]
            near = event.time_s - last.time_s <= _TOGETHER_S
            if not (near and event.what == last.what and event.what in _GROUPED):
                yield group
                group = []
        group.append((place, event))
    if group:
        yield group


def _paragraph(group: list[tuple[int, Event]]) -> Paragraph:
    events = [event for _, event in group]
    first, places = events[0], tuple(place for place, _ in group)
    if len(events) == 1:
        return Paragraph(first.time_s, first.what, _sentence(first.text), first.why, places)
    text, why = _together(first.what, events)
    return Paragraph(first.time_s, first.what, text, why, places)


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + "."


def _together(what: str, events: list[Event]) -> tuple[str, str]:
    """Several events of one kind as a sentence, and why they happened."""
    whys = dict.fromkeys(event.why for event in events if event.why)
    who = numbers_text(tuple(dict.fromkeys(agent for event in events for agent in event.agents)))
    who = who[:1].upper() + who[1:]
    if what == "swap":
        pairs = _named([f"{event.agents[0]} ↔ {event.agents[1]}" for event in events])
        return (
            f"{len(events)} pairs swap their slots: {pairs}.",
            "together they are nearer to their slots then",
        )
    if what == "takeover":
        steps = _named(
            [f"{event.agents[0]} takes slot {event.slots[0]}, which {event.of} held" for event in events],
            "; ",
        )
        return f"The ranks close: {steps}.", "an inner slot must not stay empty; only one at the rim may"
    if what == "move":
        return f"{who} are in other slots now.", next(iter(whys), "")
    if what == "detour":
        stones = sorted({event.obstacle for event in events if event.obstacle is not None})
        by = f"obstacle {stones[0]}" if len(stones) == 1 else f"obstacles {', '.join(map(str, stones))}"
        return f"{who} fly around {by}.", "stopped on the way to their slots"
    doing = {
        "kill": "die", "freeze": "hang: they sense, hear and answer nothing", "thaw": "go on",
        "restart": "begin anew, knowing nothing", "slow": "have only a share of their acceleration left",
        "recover": "have all of their acceleration again", "lost": "are out of the air",
        "lie": "lie by radio", "truth": "tell the truth again",
    }[what]  # fmt: skip
    return f"{who} {doing}." if len(who) < 100 else f"{agents_text(len(events))} {doing}.", "; ".join(whys)


def _named(texts: list[str], between: str = ", ") -> str:
    more = len(texts) - _MOST_NAMED
    return between.join(texts[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
