"""Launches that go well, go wrong and are cut down: whatever happens, nothing is left behind.

Every story is a small launcher in a fresh interpreter, because a launcher must be single threaded and must
never have opened Zenoh, and because some stories kill it.
"""

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

ROOT = Path(__file__).resolve().parents[2]

PREAMBLE = """
import os, signal, sys, time
from pathlib import Path
from protocols.whole_file import write_whole
from rsc_swarm.flight.processes import Supervisor, leave_on_sigterm
from rsc_swarm.flight.socket_folder import RunFolder

here = Path(sys.argv[1])

def polite(name):
    leave = leave_on_sigterm()
    write_whole(here / name, str(os.getpid()))
    while not leave.asked:
        time.sleep(0.01)
    (here / f"{name} left").write_text("")

def stubborn(name):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    write_whole(here / name, str(os.getpid()))
    time.sleep(60.0)

def beating(name):
    for beat in range(6000):
        write_whole(here / name, str(beat))
        time.sleep(0.01)

def await_files(*names):
    deadline = time.monotonic() + 5.0
    while not all((here / name).exists() for name in names):
        assert time.monotonic() < deadline, names
        time.sleep(0.005)
"""


def launcher(story: str, here: Path) -> "subprocess.Popen[str]":
    """Start ``story`` as a launcher whose run folders and children's files lie in ``here``."""
    return subprocess.Popen(
        [sys.executable, "-c", PREAMBLE + textwrap.dedent(story), str(here)],
        cwd=ROOT,
        env={**os.environ, "XDG_RUNTIME_DIR": str(here)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


@pytest.fixture
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


@pytest.fixture
def tell(here: Path) -> Callable[[str], list[str]]:
    """Run a story to its end; returns the lines it printed."""

    def run(story: str) -> list[str]:
        process = launcher(story, here)
        out, err = process.communicate(timeout=120.0)
        assert process.returncode == 0, err
        return out.splitlines()

    return run


@pytest.fixture
def begin(here: Path) -> Iterator[Callable[[str], "subprocess.Popen[str]"]]:
    """Start a story that the test is going to cut short, and wait until it prints its first line."""
    begun: list[subprocess.Popen[str]] = []

    def start(story: str) -> "subprocess.Popen[str]":
        process = launcher(story, here)
        begun.append(process)
        assert process.stdout is not None
        assert process.stdout.readline().strip() == "ready", process.communicate()
        return process

    yield start
    for process in begun:
        process.kill()
        process.communicate()


def eventually(happened: Callable[[], bool], within_s: float) -> bool:
    deadline = time.monotonic() + within_s
    while not happened():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def run_folders(here: Path) -> list[Path]:
    return list(here.glob("rsc-swarm-run-*"))


def alive(here: Path, *names: str) -> list[str]:
    """Which of them live. One that has ended but awaits its burial by the system's first process does not."""

    def lives(pid: int) -> bool:
        try:
            return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
        except psutil.NoSuchProcess:
            return False

    return [name for name in names if lives(int((here / name).read_text()))]


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


@pytest.mark.parametrize("number", ["SIGINT", "SIGHUP"])
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
            print([(end.name, end.code, end.signal) for end in ends], 0.25 < took < 1.0, swarm.running)
        try:
            os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            print("nobody left")
        """
    )
    assert lines == ["[('polite', 0, None), ('stubborn', None, 9)] True ('spared',)", "nobody left"]
    assert (here / "polite left").exists()


WHOLE_SWARM = """
with RunFolder() as folder, Supervisor(grace_s=0.5) as swarm:
    folder.socket.write_text("")
    swarm.start("world", polite, "world", at_launcher_death=signal.SIGCONT, run_folder=folder.path)
    for name, target in (("polite", polite), ("stubborn", stubborn), ("frozen", polite)):
        swarm.start(name, target, name)
    await_files("world", "polite", "stubborn", "frozen")
    swarm.freeze("frozen")
    print("ready", flush=True)
    while True:
        for end in swarm.wait(10.0):
            sys.exit(f"lost {end.name}")
"""
EVERYONE = ("world", "polite", "stubborn", "frozen")


def test_when_the_launcher_is_killed_outright_all_end_and_the_world_cleans_up(
    begin: Callable[[str], "subprocess.Popen[str]"], here: Path
) -> None:
    process = begin(WHOLE_SWARM)
    assert alive(here, *EVERYONE) == list(EVERYONE)
    assert len(run_folders(here)) == 1
    process.kill()
    process.wait()
    assert eventually(lambda: not alive(here, *EVERYONE), within_s=2.0), alive(here, *EVERYONE)
    assert (here / "world left").exists()
    assert run_folders(here) == []


def test_a_world_that_is_stopped_does_not_outlive_its_launcher(
    begin: Callable[[str], "subprocess.Popen[str]"], here: Path
) -> None:
    process = begin(WHOLE_SWARM)
    os.kill(int((here / "world").read_text()), signal.SIGSTOP)
    process.kill()
    process.wait()
    assert eventually(lambda: not alive(here, *EVERYONE), within_s=8.0), alive(here, *EVERYONE)
    assert (here / "world left").exists()
    assert run_folders(here) == []


def test_a_world_that_cannot_leave_does_not_outlive_its_launcher(
    begin: Callable[[str], "subprocess.Popen[str]"], here: Path
) -> None:
    process = begin(
        """
        def stuck(name):
            leave_on_sigterm()
            write_whole(here / name, str(os.getpid()))
            while True:
                time.sleep(0.01)

        with Supervisor() as swarm:
            swarm.start("world", stuck, "world", at_launcher_death=signal.SIGCONT)
            await_files("world")
            print("ready", flush=True)
            time.sleep(60.0)
        """
    )
    process.kill()
    process.wait()
    assert eventually(lambda: not alive(here, "world"), within_s=8.0)


def test_ctrl_c_reaches_the_children_as_a_request_to_leave(
    begin: Callable[[str], "subprocess.Popen[str]"], here: Path
) -> None:
    process = begin(WHOLE_SWARM)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all of them
    assert "KeyboardInterrupt" in process.communicate(timeout=10.0)[1]
    assert alive(here, *EVERYONE) == []
    assert {path.name for path in here.glob("* left")} == {"world left", "polite left", "frozen left"}
    assert run_folders(here) == []


def test_a_world_that_is_killed_is_reported_and_its_folder_removed(
    begin: Callable[[str], "subprocess.Popen[str]"], here: Path
) -> None:
    process = begin(WHOLE_SWARM)
    os.kill(int((here / "world").read_text()), signal.SIGKILL)
    assert "lost world" in process.communicate(timeout=10.0)[1]
    assert process.returncode == 1
    assert alive(here, *EVERYONE) == []
    assert run_folders(here) == []


def test_a_folder_that_nobody_could_remove_goes_with_the_next_launch(
    tell: Callable[[str], list[str]], here: Path
) -> None:
    lines = tell(
        """
        long_ago = time.time() - 3600.0
        abandoned, in_use = RunFolder(), RunFolder()
        os.close(abandoned._lock)
        for folder in (abandoned, in_use):
            os.utime(folder.path, (long_ago, long_ago))
        with RunFolder() as fresh:
            print(abandoned.path.exists(), in_use.path.exists(), oct(fresh.path.stat().st_mode & 0o777))
            print(fresh.endpoint == f"unixsock-stream/{fresh.path}/world.sock")
        in_use.remove()
        """
    )
    assert lines == ["False True 0o700", "True"]
    assert run_folders(here) == []


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


def test_the_bare_echo_runs_and_leaves_nothing_behind(tell: Callable[[str], list[str]], here: Path) -> None:
    lines = tell(
        """
        from rsc_swarm.bench.echo import bare_echo
        print(bare_echo(agents=3, ticks=100) > 20.0)
        try:
            bare_echo(agents=1, endpoint="unixsock-stream//no/such/folder/world.sock")
        except RuntimeError as error:
            print(error)
        """
    )
    assert lines[0] == "True"
    assert lines[1].startswith("the echo broke off: world: LinkError: cannot listen on")
    assert list(here.iterdir()) == []


def test_a_frozen_drone_does_not_hold_up_the_world_and_hears_again_when_thawed(
    tell: Callable[[str], list[str]],
) -> None:
    lines = tell(
        """
        from agent.radio.link import AgentLink
        from world.server.credentials import Credentials
        from world.server.link import WorldLink

        credentials = Credentials.fresh("wedge", 1)

        def drone(endpoint):
            with AgentLink(endpoint, credentials.login(0)) as link:
                link.send(b"here")
                while (heard := link.receive(5.0)) != b"end":
                    link.send(heard[:5])

        def world(endpoint, drone_pid):
            with WorldLink(credentials, [endpoint]) as link:
                (here / "world").touch()
                assert link.receive(5.0) == (0, b"here")
                os.kill(int(drone_pid.read_text()), signal.SIGSTOP)
                started = time.monotonic()
                for _ in range(20):  # as many as the world sends unanswered
                    link.send(0, bytes(1200))
                print("20 sends to a frozen drone took less than 1 s:", time.monotonic() - started < 1.0)
                os.kill(int(drone_pid.read_text()), signal.SIGCONT)
                while link.receive(0.3):
                    pass
                link.send(0, b"again")
                print(link.receive(5.0))
                link.send(0, b"end")
                time.sleep(0.1)

        with RunFolder() as folder, Supervisor() as swarm:
            pid_file = folder.path / "drone"
            swarm.start("world", world, folder.endpoint, pid_file)
            await_files("world")
            pid_file.write_text(str(swarm.start("agent-0", drone, folder.endpoint)))
            while swarm.running:
                for end in swarm.wait(10.0):
                    assert end.code == 0, end
        """
    )
    assert lines == ["20 sends to a frozen drone took less than 1 s: True", "(0, b'again')"]
