"""Compiled rules: what flies is what stands in the sources, wherever they lie and whatever has been kept; and the compiler's
memory, once everything is compiled."""

import os
import shutil
import subprocess
import sys
import zipfile
from collections import namedtuple
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from protocols import kept
from protocols.dynamics import clip_ball
from protocols.kept import cache_folder, fingerprint, sources_of
from protocols.kernels import COMPILED, by_reference, kernel, rebound, release_memory

ROOT = Path(__file__).resolve().parents[2]
compiled = pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
PACKAGES = ("protocols", "agent", "world", "rsc_swarm")
LOADED = (  # the project's files that a module loads when it is imported
    "import importlib, sys; importlib.import_module(sys.argv[1]); "
    "print(*(m.__file__ for n, m in sys.modules.items()"
    " if n.split('.')[0] in ('protocols', 'agent', 'world', 'rsc_swarm') and m.__file__))"
)

# A small kernel that rests on a constant of each package: what it says now, and after they have been edited.
PROBE = """
from agent.control.gains import GAINS
from protocols.dynamics import TICK_S
from protocols.kernels import kernel
from rsc_swarm.batch.stage import PAST
from world.medium.chance import LOSS

@kernel
def probe() -> tuple[float, float, float, float]:
    return TICK_S, GAINS.slot_pull, LOSS, PAST

if __name__ == "__main__":
    print(*probe())
"""
BEFORE = "0.01 2.67 2 4"
EDITS = [
    ("protocols/dynamics.py", "TICK_S = 0.01", "TICK_S = 0.02"),
    ("agent/control/gains.py", "slot_pull: float = 2.67", "slot_pull: float = 99.0"),
    ("world/medium/chance.py", "LOSS = 2", "LOSS = 7"),
    ("rsc_swarm/batch/stage.py", "PAST = 4", "PAST = 5"),
]
AFTER = "0.02 99.0 7 5"
NAME = (  # what kernels of this file are named after
    "import pathlib, sys, protocols.kept as k; print(k.fingerprint(pathlib.Path(sys.argv[1]).resolve()))"
)
# Any small rule, where only what is kept matters.
CLIP = "from protocols.dynamics import clip_ball; print(*clip_ball(3.0, 4.0, 10.0))"
CLIPPED = "3.0 4.0"
# Rules as they are, each with a constant of another file in it.
TRACK = (
    "import numpy as np; from agent.control.follow import Plan, track_row; plan = np.ones((2, 2), np.float32); "
    "print(track_row(1, Plan(np.zeros(4), 0 * plan, plan), (0.0, 0.0), (0.0, 0.0), False)[0])"
)
LOSE = (
    "from world.medium.medium import dropped_by; "
    "print(*(dropped_by(0.5, 3, 1, 2, tick, True, False) for tick in range(40)))"
)


def place(folder: Path) -> Path:
    """The project's packages, copied to ``folder``."""
    for package in PACKAGES:
        shutil.copytree(
            ROOT / package,
            folder / package,
            ignore=shutil.ignore_patterns("__pycache__", "*.onnx", "compiled"),
        )
    (folder / "rsc_swarm" / "probe.py").write_text(PROBE)
    return folder


def run(checkout: Path, home: Path, *command: str, **environment: str) -> str:
    """What Python prints when it runs ``command`` with the packages of ``checkout``; whatever it keeps goes below ``home``."""
    done = subprocess.run(
        [sys.executable, *command], cwd=checkout, capture_output=True, text=True, check=False,
        env={
            "PATH": os.environ["PATH"], "HOME": str(home), "TMPDIR": str(home), "PYTHONDONTWRITEBYTECODE": "1",
            "PYTHONPATH": str(checkout), **environment,
        },
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


def clip_anew() -> tuple[float, float]:
    """`CLIP`, as a process does that has not called the rule before."""
    return kernel(clip_ball.py_func)(3.0, 4.0, 10.0)  # type: ignore[attr-defined, no-any-return]


def kept_files(home: Path) -> list[Path]:
    return sorted(path for path in home.rglob("*") if path.is_file())


@pytest.fixture
def home(tmp_path: Path) -> Path:
    (tmp_path / "home").mkdir()
    return tmp_path / "home"


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    return place(tmp_path / "checkout")


@pytest.fixture
def fresh_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """A folder of our own that nothing has looked at; where else one might look there is nothing."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setenv("HOME", str(tmp_path / "nothing" / "home"))
    monkeypatch.setattr(kept.tempfile, "gettempdir", lambda: "/dev/null/nowhere")
    monkeypatch.setattr(kept, "_SHIPPED", tmp_path / "nothing")
    (tmp_path / "nothing").touch()
    (tmp_path / "xdg").mkdir()
    cache_folder.cache_clear()
    yield tmp_path / "xdg" / "rsc-swarm"
    cache_folder.cache_clear()


def test_an_edited_constant_of_any_package_flies(checkout: Path, home: Path) -> None:
    assert run(checkout, home, "-m", "rsc_swarm.probe") == BEFORE
    names = {run(checkout, home, "-c", NAME, "rsc_swarm/probe.py")}
    for file, text, edited in EDITS:
        whole = (checkout / file).read_text()
        assert whole.count(text) == 1, f"{file} has no longer {text}"
        (checkout / file).write_text(whole.replace(text, edited))
        names.add(run(checkout, home, "-c", NAME, "rsc_swarm/probe.py"))
    assert len(names) == 1 + len(EDITS), "each of them names anew what is kept"
    assert run(checkout, home, "-m", "rsc_swarm.probe") == AFTER


@pytest.mark.parametrize(("rule", "edit"), [(TRACK, EDITS[0]), (LOSE, EDITS[2])], ids=["track", "lose"])
def test_a_rule_flies_an_edited_constant_of_another_file(
    rule: str, edit: tuple[str, str, str], checkout: Path, home: Path
) -> None:
    before = run(checkout, home, "-c", rule)
    file = checkout / edit[0]
    file.write_text(file.read_text().replace(edit[1], edit[2]))
    assert run(checkout, home, "-c", rule) != before


@pytest.mark.parametrize(
    "module", ["agent.tick", "agent.policy.saber", "world.tick", "rsc_swarm.batch.kernel"]
)
def test_a_kernel_is_named_after_every_file_that_its_module_loads(module: str) -> None:
    file = ROOT / f"{module.replace('.', '/')}.py"
    loaded = {Path(name) for name in run(ROOT, ROOT, "-c", LOADED, module).split()}
    assert file in loaded
    assert loaded <= set(sources_of(file))


def test_two_checkouts_share_what_either_compiled(checkout: Path, home: Path, tmp_path: Path) -> None:
    other = place(tmp_path / "elsewhere" / "deep")
    expected = fingerprint(ROOT / "agent" / "tick.py")
    named = [run(one, home, "-c", NAME, "agent/tick.py") for one in (checkout, other)]
    assert named == [expected, expected]
    run(checkout, home, "-c", CLIP)
    kept = {path: path.stat().st_mtime_ns for path in kept_files(home)}
    assert len(kept) == 1
    run(other, home, "-c", CLIP)
    assert {path: path.stat().st_mtime_ns for path in kept_files(home)} == kept


@compiled
def test_a_wheel_brings_along_what_was_compiled_for_any_processor(
    checkout: Path, home: Path, tmp_path: Path
) -> None:
    for file in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / file, checkout / file)
    assert run(checkout, home, "-c", f"import protocols.kept as k; k.ship(); {CLIP}") == CLIPPED
    build = "pip wheel --quiet --no-deps --no-build-isolation --disable-pip-version-check --wheel-dir"
    run(checkout, home, "-m", *build.split(), str(tmp_path / "dist"), ".")
    (wheel,) = (tmp_path / "dist").iterdir()
    installed = tmp_path / "installed"
    zipfile.ZipFile(wheel).extractall(installed)
    assert len(list((installed / "protocols" / "compiled").rglob("*.o"))) == 1

    before = kept_files(home)
    flies = f"{CLIP}; import sys; print('numba' in sys.modules)"
    assert run(installed, home, "-c", flies) == f"{CLIPPED}\nFalse"
    assert kept_files(home) == before, "there was nothing to compile"

    with (installed / "protocols" / "dynamics.py").open("a") as edited:
        edited.write("\n")
    assert run(installed, home, "-c", CLIP) == CLIPPED
    assert len(kept_files(home)) == len(before) + 1, "of other sources it is compiled"


def test_importing_any_module_touches_no_folder(home: Path) -> None:
    modules = [
        ".".join(file.relative_to(ROOT).with_suffix("").parts)
        for package in PACKAGES
        for file in sorted((ROOT / package).rglob("*.py"))
        if file.name != "__main__.py" and not {"training", "plots"} & set(file.parts)  # torch, matplotlib
    ]
    run(ROOT, home, "-c", f"import importlib\nfor name in {modules}: importlib.import_module(name)")
    assert list(home.rglob("*")) == []


@compiled
def test_a_damaged_file_is_compiled_again(fresh_cache: Path) -> None:
    assert clip_anew() == (3.0, 4.0)
    (kept,) = kept_files(fresh_cache)
    whole = kept.read_bytes()
    middle = len(whole) // 2
    for damaged in (b"", whole[:middle], whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]):
        kept.write_bytes(damaged)
        assert clip_anew() == (3.0, 4.0)
        assert kept.read_bytes() == whole


def test_without_room_on_the_disk_kernels_run_all_the_same(home: Path) -> None:
    full = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)); "
    assert run(ROOT, home, "-c", full + CLIP) == CLIPPED
    assert kept_files(home) == []


@compiled
def test_without_any_folder_kernels_run_all_the_same(
    fresh_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/nowhere")
    assert clip_anew() == (3.0, 4.0)
    assert cache_folder() is None
    assert kept_files(tmp_path / "xdg") == []


def test_without_a_home_kernels_are_kept_among_temporary_files(
    fresh_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", homeless)
    monkeypatch.setattr(kept.tempfile, "gettempdir", lambda: str(tmp_path))
    assert cache_folder() == tmp_path / f"rsc-swarm-cache-{os.getuid()}"


def test_a_folder_of_our_own_is_made_for_us_alone(fresh_cache: Path) -> None:
    assert cache_folder() == fresh_cache
    assert fresh_cache.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777])
def test_a_folder_that_others_may_write_to_is_not_used(fresh_cache: Path, mode: int) -> None:
    fresh_cache.mkdir()
    fresh_cache.chmod(mode)
    assert cache_folder() is None


def test_a_link_or_a_file_is_not_used(fresh_cache: Path, tmp_path: Path) -> None:
    (tmp_path / "trap").mkdir(mode=0o700)
    fresh_cache.symlink_to(tmp_path / "trap")
    assert cache_folder() is None
    fresh_cache.unlink()
    fresh_cache.touch()
    cache_folder.cache_clear()
    assert cache_folder() is None


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder away")
def test_somebody_elses_folder_is_not_used(fresh_cache: Path) -> None:
    fresh_cache.mkdir(mode=0o700)
    os.chown(fresh_cache, 12345, 12345)
    assert cache_folder() is None


@compiled
def test_a_trap_inside_our_folder_is_not_used(fresh_cache: Path) -> None:
    clip_anew()
    (kept,) = kept_files(fresh_cache)
    kept.parent.chmod(0o777)
    kept.write_bytes(b"a trap")
    assert clip_anew() == (3.0, 4.0)
    assert kept.read_bytes() == b"a trap"


def resident_code_kb() -> int:
    """Of the compiler's code, what is in memory for this process."""
    resident, inside = 0, False
    for line in Path("/proc/self/smaps").read_text().splitlines():
        if "-" in line.split()[0]:
            inside = "libllvmlite" in line and " r-xp " in line
        elif inside and line.startswith("Rss:"):
            resident += int(line.split()[1])
    return resident


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_compilers_memory_is_given_back_and_it_still_compiles():
    kernel(lambda x: x + 1)(1)
    before = resident_code_kb()
    release_memory()
    assert resident_code_kb() < before / 4
    assert kernel(lambda x: x * 2)(3) == 6


Pair = namedtuple("Pair", "factor values")


@kernel
def mixed(flag: bool, number: float, count: int, pair: Pair) -> tuple[bool, tuple[float, int], float]:
    return not flag, (number * 2, count + 1), pair.factor * pair.values[0]


@compiled
@pytest.mark.parametrize(
    "number", [0.5, np.float64(0.5), np.float32(0.5), np.float16(0.5)], ids=lambda n: type(n).__name__
)
@pytest.mark.parametrize("count", [3, np.int64(3), np.int32(3), np.uint8(3)], ids=lambda n: type(n).__name__)
def test_a_number_is_the_same_to_a_rule_however_narrow_it_is(number: float, count: int) -> None:
    pair = Pair(number, np.array([8.0]))
    for given in (pair, by_reference(pair)):
        assert mixed(True, number, count, given) == (False, (1.0, 4), 4.0)
        assert mixed(np.False_, number, count, given) == (True, (1.0, 4), 4.0)


@compiled
@pytest.mark.parametrize("value", [2**64, -(2**63) - 1, 1j, np.longdouble(1), None, "1"])
def test_what_is_no_number_of_64_bits_is_refused(value: object) -> None:
    for given in (
        lambda: mixed(True, value, 3, Pair(1.0, np.zeros(1))),
        lambda: by_reference(Pair(value, np.zeros(1))),
    ):
        with pytest.raises(TypeError, match="a kernel takes arrays, numbers of 64 bits"):
            given()


def test_a_rule_that_is_bound_anew_answers_what_is_asked_now() -> None:
    ask, values = rebound(mixed), np.array([8.0])
    one, other = by_reference(Pair(0.5, values)), by_reference(Pair(2.0, values))
    assert ask(True, 1.0, 3, one)[2] == 4.0
    values[0] = 6.0
    assert [ask(True, 1.0, 3, given)[2] for given in (one, other, one)] == [3.0, 12.0, 3.0]
    assert [ask(flag, number, 3, one)[:2] for flag, number in ((True, 1.0), (False, 2.5))] == [
        (False, (2.0, 4)),
        (True, (5.0, 4)),
    ]
