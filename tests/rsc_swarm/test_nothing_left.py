"""Launches that go well, go wrong and are cut down: whatever happens, nothing is left behind."""

import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

from tests.rsc_swarm.stories import alive, run_folders
from tests.scenarios.flights import eventually

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
    assert eventually(lambda: not alive(here, *EVERYONE), within_s=20.0), alive(here, *EVERYONE)
    assert (here / "world left").exists()
    assert run_folders(here) == []


def test_a_world_that_is_stopped_does_not_outlive_its_launcher(
    begin: Callable[[str], "subprocess.Popen[str]"], here: Path
) -> None:
    process = begin(WHOLE_SWARM)
    os.kill(int((here / "world").read_text()), signal.SIGSTOP)
    process.kill()
    process.wait()
    assert eventually(lambda: not alive(here, *EVERYONE), within_s=20.0), alive(here, *EVERYONE)
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
    assert eventually(lambda: not alive(here, "world"), within_s=20.0)


def test_ctrl_c_reaches_the_children_as_a_request_to_leave(
    begin: Callable[[str], "subprocess.Popen[str]"], here: Path
) -> None:
    process = begin(WHOLE_SWARM)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all of them
    assert "KeyboardInterrupt" in process.communicate(timeout=60.0)[1]
    assert alive(here, *EVERYONE) == []
    assert {path.name for path in here.glob("* left")} == {"world left", "polite left", "frozen left"}
    assert run_folders(here) == []


def test_a_world_that_is_killed_is_reported_and_its_folder_removed(
    begin: Callable[[str], "subprocess.Popen[str]"], here: Path
) -> None:
    process = begin(WHOLE_SWARM)
    os.kill(int((here / "world").read_text()), signal.SIGKILL)
    assert "lost world" in process.communicate(timeout=60.0)[1]
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
        os.close(abandoned._held)
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
                print("20 sends to a frozen drone took less than 3 s:", time.monotonic() - started < 3.0)
                os.kill(int(drone_pid.read_text()), signal.SIGCONT)
                link.send(0, b"again")
                while (said := link.receive(20.0)) and said != (0, b"again"):
                    pass
                print(said)
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
    assert lines == ["20 sends to a frozen drone took less than 3 s: True", "(0, b'again')"]
