"""Processes that a launcher starts, watches and ends: each end is told once, and who is asked to leave can do so in peace."""

import errno
import os
from collections.abc import Callable
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import psutil
import pytest

from rsc_swarm.flight.world_process import PipeControl


def test_every_end_is_reported_once_by_name(tell: Callable[[str], list[str]]) -> None:
    lines = tell(
        """
        with Supervisor() as swarm:
            swarm.start("calm", print, log=here / "calm.log")
            swarm.start("blunt", sys.exit, 3)
            swarm.start("shot", beating, "shot")
            await_files("shot")
            swarm.kill("shot")
            ends = {}
            while swarm.running:
                for end in swarm.wait(5.0):
                    assert end.name not in ends
                    ends[end.name] = end
            for name in ("calm", "blunt", "shot"):
                print(str(ends[name]).replace(str(ends[name].pid), "N"))
            print(swarm.poll())
        """
    )
    assert lines == [
        "calm (process N) ended with exit code 0",
        "blunt (process N) ended with exit code 3",
        "shot (process N) was ended by SIGKILL",
        "[]",
    ]


def test_many_are_started_at_once_and_none_if_one_of_them_runs_already(
    tell: Callable[[str], list[str]],
) -> None:
    lines = tell(
        """
        from rsc_swarm.flight.processes import Start
        with Supervisor() as swarm:
            swarm.start("shot", beating, "shot")
            for names in (("new", "shot"), ("new", "new")):
                try:
                    swarm.start_all([Start(name, beating, (name,)) for name in names])
                except ValueError as error:
                    print(str(error).split(":")[0], swarm.running)
            pids = swarm.start_all([Start(f"agent-{n}", sys.exit, (n,)) for n in (3, 4)])
            print(pids == [swarm.pid("agent-3"), swarm.pid("agent-4")])
            ends = {}
            while len(swarm.running) > 1:
                ends |= {end.name: end.code for end in swarm.wait(5.0)}
            print(sorted(ends.items()))
        """
    )
    assert lines == [
        "shot is still running ('shot',)",
        "new is still running ('shot',)",
        "True",
        "[('agent-3', 3), ('agent-4', 4)]",
    ]


def test_where_no_more_may_be_started_those_before_are_told_of_and_ended(
    tell: Callable[[str], list[str]],
) -> None:
    lines = tell(
        """
        import errno, os
        from rsc_swarm.flight.processes import Start, StartError
        forks = iter((True, True, False))
        fork = os.fork
        def limited():
            if next(forks):
                return fork()
            raise OSError(errno.EAGAIN, "Resource temporarily unavailable")
        os.fork = limited
        with Supervisor() as swarm:
            try:
                swarm.start_all([Start(f"agent-{n}", polite, (f"agent-{n}",)) for n in range(3)])
            except StartError as error:
                print(str(error).split(":")[0])
            print(swarm.running)
            print(len(swarm.stop(5.0)))
        """
    )
    assert lines == [
        "agent-2 cannot be started (Resource temporarily unavailable)",
        "('agent-0', 'agent-1')",
        "2",
    ]


def test_what_a_child_says_and_why_it_failed_is_in_its_log(
    tell: Callable[[str], list[str]], here: Path
) -> None:
    lines = tell(
        """
        def failing():
            print("engines on")
            raise ValueError("no such\\n formation")

        with Supervisor() as swarm:
            swarm.start("agent-4", failing, log=here / "agent-4.log")
            print(swarm.wait(5.0)[0].code)
        """
    )
    assert lines == ["1"]
    log = (here / "agent-4.log").read_text().splitlines()
    assert log[:2] == ["engines on", "agent-4: ValueError: no such formation"]
    assert log[2] == "Traceback (most recent call last):"


def test_a_drone_may_be_started_again_under_its_name_once_its_end_is_known(
    tell: Callable[[str], list[str]],
) -> None:
    lines = tell(
        """
        with Supervisor() as swarm:
            first = swarm.start("agent-0", polite, "one")
            try:
                swarm.start("agent-0", polite, "two")
            except ValueError as error:
                print(error)
            swarm.kill("agent-0")
            print([end.name for end in swarm.wait(5.0)])
            print(swarm.start("agent-0", polite, "two") != first)
            await_files("two")
            print([str(end.code) for end in swarm.stop(5.0)])
            try:
                swarm.freeze("agent-0")
            except ValueError as error:
                print(error)
        """
    )
    assert lines[0].startswith("agent-0 is still running: stop it, or kill it")
    assert lines[1:] == ["['agent-0']", "True", "['0']", "agent-0 is not running: running are none"]


def test_a_frozen_drone_stands_still_and_a_thawed_one_goes_on(tell: Callable[[str], list[str]]) -> None:
    lines = tell(
        """
        def beat():
            return (here / "heart").read_text()

        with Supervisor() as swarm:
            swarm.start("agent-0", beating, "heart")
            await_files("heart")
            swarm.freeze("agent-0")
            time.sleep(0.05)
            before = beat()
            time.sleep(0.15)
            print(beat() == before, swarm.poll())
            swarm.thaw("agent-0")
            time.sleep(0.15)
            print(beat() != before)
            swarm.freeze("agent-0")
            print(swarm.stop(5.0)[0].signal == signal.SIGTERM)
        """
    )
    assert lines == ["True []", "True", "True"]


def test_a_frozen_child_that_answers_signals_itself_is_thawed_to_leave(
    tell: Callable[[str], list[str]],
) -> None:
    """One that does not would be ended by SIGTERM even while it is stopped."""
    lines = tell(
        """
        with Supervisor() as swarm:
            swarm.start("frozen", polite, "frozen")
            await_files("frozen")
            swarm.freeze("frozen")
            print([(end.code, end.signal) for end in swarm.stop(5.0)])
            swarm.start("asked", polite, "asked")
            await_files("asked")
            swarm.freeze("asked")
            swarm.ask("asked")
            print([(end.code, end.signal) for end in swarm.wait(5.0)])
            swarm.ask("nobody")
        """
    )
    assert lines == ["[(0, None)]"] * 2


@pytest.mark.parametrize("number", ["SIGINT", "SIGHUP", "SIGQUIT"])
def test_what_a_terminal_sends_to_all_is_answered_by_the_launcher_alone(
    tell: Callable[[str], list[str]], number: str
) -> None:
    lines = tell(
        f"""
        with Supervisor() as swarm:
            pid = swarm.start("polite", polite, "polite")
            await_files("polite")
            os.kill(pid, signal.{number})
            print(swarm.wait(0.2))
            print([end.code for end in swarm.stop(5.0)])
        """
    )
    assert lines == ["[]", "[0]"]


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_within_the_block_a_signal_only_asks_and_afterwards_all_is_as_before(
    tell: Callable[[str], list[str]], number: str
) -> None:
    lines = tell(
        f"""
        from rsc_swarm.machine.leaving import leave_when_asked
        before = signal.getsignal(signal.{number})
        with leave_when_asked() as leave:
            print(leave.asked)
            for _ in range(3):
                os.kill(os.getpid(), signal.{number})
            print(leave.asked)
        print(signal.getsignal(signal.{number}) is before)
        """
    )
    assert lines == ["False", "True", "True"]


def test_stop_asks_first_and_then_makes_sure(tell: Callable[[str], list[str]], here: Path) -> None:
    lines = tell(
        """
        with Supervisor() as swarm:
            swarm.start("polite", polite, "polite")
            swarm.start("stubborn", stubborn, "stubborn")
            swarm.start("spared", beating, "spared")
            await_files("polite", "stubborn", "spared")
            started = time.monotonic()
            ends = swarm.stop(0.3, ["polite", "stubborn"])
            took = time.monotonic() - started
            print([(end.name, end.code, end.signal) for end in ends], 0.25 < took < 5.0, swarm.running)
        try:
            os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            print("nobody left")
        """
    )
    assert lines == ["[('polite', 0, None), ('stubborn', None, 9)] True ('spared',)", "nobody left"]
    assert (here / "polite left").exists()


def test_a_launcher_that_has_opened_zenoh_is_told_so_instead_of_hanging(
    tell: Callable[[str], list[str]],
) -> None:
    lines = tell(
        """
        import zenoh
        zenoh.open(zenoh.Config.from_json5('{mode: "router", listen: {endpoints: []}}')).close()
        try:
            Supervisor().start("agent-0", print)
        except RuntimeError as error:
            print(error)
        """
    )
    assert len(lines) == 1
    assert lines[0].startswith("this process has opened Zenoh")


def test_of_whatever_the_world_has_shown_its_launcher_has_the_figures() -> None:
    ours, theirs = Pipe()
    shown: Any = "a picture"
    figures: Any = "its figures"
    control = PipeControl(theirs, lambda: False)
    control.so_far = lambda: figures
    control.show(shown)
    assert [ours.recv(), ours.recv()] == [("so far", figures), ("show", shown)]


def test_a_world_that_may_open_no_more_files_takes_no_drone_for_stopped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It asks the system about a drone that is late, and one drone may have opened all the files there are."""

    def no_more(pid: int) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    ours, theirs = Pipe()
    control = PipeControl(theirs, lambda: False)
    ours.send(("started", 0, os.getpid()))
    assert control.lost() == []
    monkeypatch.setattr(psutil, "Process", no_more)
    assert not control.paused(0)
