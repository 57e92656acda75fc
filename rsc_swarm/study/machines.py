"""Many machines: the workers of a Dask scheduler, through the interface of ``concurrent.futures``.

Whatever flies many flights takes an executor (rsc_swarm.study.workers). Here is the one that ``--on`` names. A task is flown anew
on another worker if its own is lost; that is Dask's. What a task is must be a function of its arguments, so that it comes to the
same wherever it is flown; that is ours, and why workers with other code are refused.
"""

import logging
import os
import re
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

from protocols.errors import BrokenError, SwarmError
from protocols.mission.document import MissionError
from rsc_swarm.study.fingerprint import whole_fingerprint

_ANSWER_S = 15.0  # for the scheduler to be there
_WORKERS_S = 30.0  # for the first worker to be there
_MOST_LOCAL = 1024
_LOCAL, _SCHEDULER = re.compile(r"local:(\d{1,4})"), re.compile(r"(tcp|tls)://\S+:\d+")


class MachinesError(BrokenError, RuntimeError):
    """There are no workers, or not such as can fly this; one line says why."""


@dataclass(frozen=True)
class Crew:
    """Who flies: an executor, or None for processes forked here; and how many tasks it works on at once."""

    workers: int
    executor: Executor | None = None


@dataclass(frozen=True)
class _SameCode:
    """A task that only a worker with our code carries out."""

    code: str
    task: Callable[..., Any]

    def __call__(self, *arguments: Any) -> Any:
        _check(socket.gethostname(), whole_fingerprint(), self.code)
        return self.task(*arguments)


def _code_there() -> str:
    """Asked of every worker."""
    return whole_fingerprint()


def _check(worker: str, theirs: str, ours: str) -> None:
    if theirs != ours:
        raise MachinesError(
            f"worker {worker} has other code ({theirs}) than this command ({ours}): install the same version there, "
            "and start it anew"
        )


class _SameCodeExecutor(Executor):
    """Another executor, on which only workers with our code carry out tasks."""

    def __init__(self, executor: Executor) -> None:
        self._executor, self._code = executor, whole_fingerprint()

    def submit(self, task: Callable[..., Any], /, *arguments: Any, **named: Any) -> Any:
        return self._executor.submit(_SameCode(self._code, task), *arguments, **named)


class Who(NamedTuple):
    """Who is to fly, as it is asked for.

    workers: processes of this machine; None: one per processor. on: ``local:4``, four Dask workers on this machine, or
    ``tcp://host:8786`` (or ``tls://``), those of a scheduler; None: no Dask.
    """

    workers: int | None = None
    on: str | None = None


def check_who(who: Who) -> None:
    """Refuse what names nobody.

    Raises:
        MissionError: one line says what would be right.
    """
    if who.workers is not None and who.workers < 1:
        raise MissionError(f"--workers: give at least 1, not {who.workers}")
    if who.on is None:
        return
    if who.workers is not None:
        raise MissionError("--workers: --on says who flies; leave one of them out")
    local = _LOCAL.fullmatch(who.on)
    if not (local and 0 < int(local[1]) <= _MOST_LOCAL) and not _SCHEDULER.fullmatch(who.on):
        raise MissionError(
            f"--on {who.on}: give local:4 for so many Dask workers on this machine, or tcp://host:8786 for those of a "
            "scheduler"
        )


@contextmanager
def crew_of(who: Who) -> Iterator[Crew]:
    """Who flies, for the time of the block.

    Raises:
        MissionError: as `check_who`, or Dask is not installed. MachinesError: nobody is there, or with other code.
    """
    check_who(who)
    on = who.on
    if on is None:
        yield Crew(who.workers or len(os.sched_getaffinity(0)))
        return
    try:
        from distributed import Client, LocalCluster
    except ModuleNotFoundError as error:
        raise MissionError(
            f"--on needs {error.name}: pip install -e '.[dask]', in the clone of rsc-swarm"
        ) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters becomes an error of ours
    if local := _LOCAL.fullmatch(on):
        with (
            LocalCluster(
                n_workers=int(local[1]),
                threads_per_worker=1,
                dashboard_address=None,
                silence_logs=logging.CRITICAL,
            ) as cluster,
            Client(cluster) as client,
        ):
            yield _crew(client, on)
        return
    try:
        client = Client(on, timeout=_ANSWER_S)
    except (OSError, TimeoutError):
        raise MachinesError(
            f"--on {on}: no scheduler answers there; start one with: dask scheduler"
        ) from None
    with client:
        yield _crew(client, on)


def _crew(client: Any, on: str) -> Crew:
    """The workers that are there now; others may come and go."""
    try:
        client.wait_for_workers(1, timeout=_WORKERS_S)
    except TimeoutError:
        raise MachinesError(
            f"--on {on}: the scheduler has no workers; start some with: dask worker {on}"
        ) from None
    try:
        codes: dict[str, str] = client.run(_code_there)
    except SwarmError:
        raise
    except Exception as error:
        raise MachinesError(f"--on {on}: a worker cannot fly: {type(error).__name__}: {error}") from None
    for worker, code in codes.items():
        _check(worker, code, whole_fingerprint())
    return Crew(len(codes), _SameCodeExecutor(client.get_executor()))
