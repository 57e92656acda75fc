"""What a corpus reaches, ``python -m tests.fuzz.reach TARGET FOLDER...``: the branches of a target's decoders that it takes."""

import inspect
import json
import sys
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from tests.fuzz.harmful import harmful
from tests.fuzz.targets import TARGETS, Target, is_declared

CORPUS = Path(__file__).parent / "corpus"
ROOT = Path(__file__).parents[2]


class Reach(NamedTuple):
    """``missing``: lines ``file:from->to`` of branches that no input takes."""

    taken: int
    branches: int
    missing: tuple[str, ...]

    @property
    def share(self) -> float:
        """Of all branches; 1 where there are none to take (the decoder is a library's)."""
        return self.taken / self.branches if self.branches else 1.0


def kept(name: str) -> dict[str, bytes]:
    """What CI reads with this target: valid inputs, and those that are kept for what they reach or what they once did."""
    seeds = {f"seed-{number}": data for number, data in enumerate(TARGETS[name].seeds())}
    files = sorted((CORPUS / name).glob("*")) if (CORPUS / name).is_dir() else []
    return {**seeds, **harmful(name), **{file.name: file.read_bytes() for file in files}}


def read_all(target: Target, inputs: Iterable[bytes]) -> None:
    """Read them all, whatever they raise."""
    for data in inputs:
        try:
            target.read(data)
        except Exception as error:
            if not is_declared(target, error):
                print(f"undeclared: {type(error).__name__} from {data[:40]!r}", file=sys.stderr)


def reach(target: Target, inputs: Iterable[bytes]) -> Reach:
    """The branches of the target's decoders that these inputs take."""
    import coverage  # of the extra fuzz; whoever only reads the corpus does without

    files = sorted({_file(decoder) for decoder in target.decoders})
    if not files:
        read_all(target, inputs)
        return Reach(0, 0, ())
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        watch = coverage.Coverage(branch=True, data_file=None, include=files, config_file=False)
        watch.start()
        read_all(target, inputs)
        watch.stop()
        report = Path(folder) / "report.json"
        watch.json_report(outfile=str(report))
        told = json.loads(report.read_text())["files"]
    taken = branches = 0
    missing: list[str] = []
    for file, function, found in _functions(told):
        if any(_belongs(decoder, file, function) for decoder in target.decoders):
            summary = found["summary"]
            taken += summary["covered_branches"]
            branches += summary["num_branches"]
            missing += [f"{file}:{begin}->{end} in {function}" for begin, end in found["missing_branches"]]
    return Reach(taken, branches, tuple(missing))


def _functions(told: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    for file, entry in told.items():
        for function, found in entry["functions"].items():
            if function:
                yield str(Path(file).resolve().relative_to(ROOT)), function, found


def _plain(decoder: Any) -> Any:
    """The function itself of a property, a kernel, a cached or a wrapped function."""
    decoder = getattr(decoder, "fget", decoder)
    return inspect.unwrap(getattr(decoder, "py_func", decoder))


def _file(decoder: Any) -> str:
    return str(Path(inspect.getfile(_plain(decoder))).resolve())


def _belongs(decoder: Any, file: str, function: str) -> bool:
    if str(ROOT / file) != _file(decoder):
        return False
    if isinstance(decoder, ModuleType):
        return True
    name = _plain(decoder).__qualname__
    return function == name or function.startswith(f"{name}.")


def main() -> None:
    name, *folders = sys.argv[1:]
    inputs = [file.read_bytes() for folder in folders for file in sorted(Path(folder).iterdir())]
    found = reach(TARGETS[name], [*kept(name).values(), *inputs])
    print(json.dumps(found._asdict()))


if __name__ == "__main__":
    main()
