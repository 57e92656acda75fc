"""A drone leaves the ground step by step, and from the air every way leads down."""

from hypothesis import given
from hypothesis import strategies as st

from agent.air.guard import Action, Verdict
from agent.air.pilot import IN_FLIGHT, TABLE, Event, Facts, Patience, Phase, Pilot, step
from agent.air.vehicle import Mode
from protocols.wire.operator import Order

WELL = Verdict(Action.PASS, ())
PATIENCE = Patience(hold_s=10.0, abort_s=2.0)
STANDING = Pilot()
CALM = Facts(0.0, None, Mode.GROUND, WELL, started=False, over=False, may_arm=True)

facts = st.builds(
    Facts,
    st.floats(0.0, 100.0),
    st.sampled_from([None, *Order]),
    st.sampled_from(Mode),
    st.builds(Verdict, st.sampled_from(Action), st.just(("why",))),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)
pilots = st.builds(Pilot, st.sampled_from(Phase), st.just(0.0), st.floats(0.0, 100.0))


def flown(*changes: dict[str, object], begin: Pilot = STANDING) -> list[Phase]:
    """The phases that a pilot goes through when these facts follow each other, one a second."""
    pilot, phases = begin, []
    for now, change in enumerate(changes):
        pilot = step(pilot, CALM._replace(now=float(now), **change), PATIENCE)
        phases.append(pilot.phase)
    return phases


def test_a_whole_flight() -> None:
    assert flown(
        {"order": Order.ARM},
        {"order": Order.TAKEOFF},
        {"mode": Mode.CLIMB},
        {"mode": Mode.HOLD},
        {"mode": Mode.FOLLOW, "started": True},
        {"mode": Mode.FOLLOW, "started": True},
        {"mode": Mode.FOLLOW, "started": True, "over": True},
        {"mode": Mode.LAND, "over": True},
        {"mode": Mode.GROUND, "over": True},
    ) == [
        Phase.ARMED,
        Phase.CLIMB,
        Phase.CLIMB,
        Phase.FORM,
        Phase.FLY,
        Phase.FLY,
        Phase.LAND,
        Phase.LAND,
        Phase.GROUND,
    ]


def test_nobody_is_armed_before_preflight_is_green() -> None:
    assert flown({"order": Order.ARM, "may_arm": False}) == [Phase.GROUND]


def test_who_is_not_armed_does_not_take_off_and_who_is_not_up_does_not_go() -> None:
    assert flown({"order": Order.TAKEOFF}, {"started": True}) == [Phase.GROUND, Phase.GROUND]
    assert flown({"order": Order.ARM}, {"started": True}) == [Phase.ARMED, Phase.ARMED]


def test_who_stands_armed_is_disarmed_by_whatever_speaks_against_flying() -> None:
    for change in ({"order": Order.LAND}, {"order": Order.ABORT}, {"verdict": Verdict(Action.HOLD, ("x",))}):
        assert flown(change, begin=Pilot(Phase.ARMED)) == [Phase.GROUND]


def test_a_vehicle_that_disarms_itself_is_on_the_ground_again() -> None:
    armed = STANDING._replace(phase=Phase.ARMED)
    after = step(armed, CALM._replace(disarmed=True), PATIENCE)
    assert (after.phase, after.reasons) == (
        Phase.GROUND, ("the vehicle disarmed itself: take off sooner after arming",),
    )  # fmt: skip


def test_one_that_does_not_leave_the_ground_does_not_do_so_later() -> None:
    climbs = STANDING._replace(phase=Phase.CLIMB)
    assert step(climbs, CALM._replace(now=4.9), PATIENCE).phase is Phase.CLIMB
    after = step(climbs, CALM._replace(now=5.1), PATIENCE)
    assert (after.phase, after.reasons) == (Phase.LAND, ("the vehicle does not leave the ground",))


def test_who_holds_lands_after_a_while_and_after_an_abort_soon() -> None:
    held = step(Pilot(Phase.FLY), CALM._replace(order=Order.HOLD, mode=Mode.FOLLOW), PATIENCE)
    assert (held.phase, held.land_at) == (Phase.HOLD, 10.0)
    aborted = step(held, CALM._replace(now=1.0, order=Order.ABORT, mode=Mode.HOLD), PATIENCE)
    assert (aborted.phase, aborted.land_at) == (Phase.HOLD, 3.0)
    assert step(aborted, CALM._replace(now=2.9, mode=Mode.HOLD), PATIENCE).phase is Phase.HOLD
    assert step(aborted, CALM._replace(now=3.0, mode=Mode.HOLD), PATIENCE).phase is Phase.LAND
    assert step(Pilot(Phase.FLY), CALM._replace(order=Order.ABORT, mode=Mode.FOLLOW), PATIENCE).land_at == 2.0


def test_the_guards_reasons_are_told() -> None:
    held = step(
        Pilot(Phase.FLY),
        CALM._replace(mode=Mode.FOLLOW, verdict=Verdict(Action.HOLD, ("position 0.20 s old",))),
        PATIENCE,
    )
    assert (held.phase, held.reasons) == (Phase.HOLD, ("position 0.20 s old",))


@given(pilots, facts)
def test_nothing_but_kill_cuts_the_motors(pilot: Pilot, told: Facts) -> None:
    after = step(pilot, told, PATIENCE)
    if after.phase is Phase.DEAD and pilot.phase is not Phase.DEAD:
        by_itself = told.mode is Mode.DEAD
        assert told.order is Order.KILL or told.verdict.action is Action.KILL or by_itself
    if told.order is Order.KILL:
        assert after.phase is Phase.DEAD


def test_a_vehicle_that_lands_by_itself_is_not_held_up() -> None:
    assert flown({"mode": Mode.LAND}, {"mode": Mode.GROUND}, begin=Pilot(Phase.FLY)) == [
        Phase.LAND,
        Phase.GROUND,
    ]
    assert flown({"mode": Mode.GROUND}, begin=Pilot(Phase.CLIMB)) == [Phase.CLIMB]  # not off the ground yet


@given(pilots, facts)
def test_from_the_air_every_way_leads_down(pilot: Pilot, told: Facts) -> None:
    """Nobody comes back to the mission, nor up from a landing; on the ground is who has landed, or was dead."""
    after = step(pilot, told, PATIENCE).phase
    order = [Phase.CLIMB, Phase.FORM, Phase.FLY, Phase.HOLD, Phase.LAND]
    if pilot.phase in IN_FLIGHT and after in IN_FLIGHT:
        assert order.index(after) >= order.index(pilot.phase)
    if pilot.phase in IN_FLIGHT and after is Phase.GROUND:
        assert pilot.phase is Phase.LAND
        assert told.mode is Mode.GROUND
    if pilot.phase is Phase.DEAD:
        assert after is Phase.DEAD


@given(st.sampled_from(sorted(IN_FLIGHT)), st.sampled_from([Action.HOLD, Action.LAND, Action.KILL]), facts)
def test_what_the_guard_says_is_done_in_the_same_tick(phase: Phase, action: Action, told: Facts) -> None:
    after = step(Pilot(phase), told._replace(verdict=Verdict(action, ("why",))), PATIENCE).phase
    strength = {Action.HOLD: 0, Action.LAND: 1, Action.KILL: 2}
    reached = {Phase.HOLD: 0, Phase.LAND: 1, Phase.GROUND: 1, Phase.DEAD: 2}
    assert reached[after] >= strength[action]


def test_every_phase_can_be_left_and_reached() -> None:
    assert {phase for phase, _ in TABLE} == set(Phase)
    assert set(TABLE.values()) == set(Phase)
    assert {event for _, event in TABLE} == set(Event)


def test_who_has_landed_says_so_though_it_is_still_being_told_to_land() -> None:
    landing = Pilot(Phase.LAND, 0.0)
    after = step(landing, CALM._replace(now=9.0, order=Order.LAND), PATIENCE)
    assert (after.phase, after.reasons) == (Phase.GROUND, ("landed",))
