"""The same flights as on other processors: what NumPy and the C library would do there, they are told to do here.

python -m tests.scenarios.processors --flights 20
python -m tests.scenarios.processors --only-here --flights 2 --seconds 3    # digests, to compare with those of another machine
"""

import argparse
import json
import os
import platform
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy._core import _multiarray_umath as _numpy

import rsc_swarm as rs

_FLY = "import json, sys; from tests.scenarios.processors import fly; print(*fly(*json.loads(sys.argv[1])))"
POLICIES = ("analytic", "saber", "rsc-h20")

Setting = Mapping[str, str]


def plain_numpy() -> Setting:
    """NumPy as on the oldest processor that it runs on: none of its loops for AVX2, AVX-512 and so on."""
    used = [name for name in _numpy.__cpu_dispatch__ if _numpy.__cpu_features__[name]]
    return {"NPY_DISABLE_CPU_FEATURES": " ".join(used)}


def plain_library() -> Setting:
    """The C library as on a processor without AVX2 and fused multiply-add: its exp, sin and cos round otherwise now and then."""
    return {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"}


def fly(policy: str, flights: int, fields: dict[str, Any]) -> list[str]:
    """The digests of flights of nine drones on maps 0, 1, ..., every second one scrambled, in this process."""
    missions = [
        rs.mission(
            agents=9, policy=policy, map_seed=n, seed=7 * n, start={"scrambled": bool(n % 2)}, **fields
        )
        for n in range(flights)
    ]
    return [flight.report.digest for flight in rs.simulate(missions)]


def digests(setting: Setting, policy: str, flights: int, **fields: object) -> list[str]:
    """As `fly`, in a process with this setting."""
    run = subprocess.run(
        [sys.executable, "-c", _FLY, json.dumps([policy, flights, fields])],
        env={**os.environ, **setting}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return run.stdout.split()


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--flights", type=int, default=20)
    options.add_argument("--seconds", type=float, help="fly no longer")
    options.add_argument("--only-here", action="store_true", help="print the digests")
    given = options.parse_args()
    flights, fields = given.flights, {"fly_s": given.seconds} if given.seconds else {}
    if given.only_here:
        for policy in POLICIES:
            print(platform.machine(), policy, *fly(policy, flights, fields), flush=True)
        return
    print(f"NumPy {np.__version__}, digests equal to those of the usual setting, of {flights} flights")
    for policy in POLICIES:
        usual = digests({}, policy, flights, **fields)
        for name, setting in (
            ("NumPy without vector loops", plain_numpy()),
            ("C library without AVX2 and FMA", plain_library()),
            ("both", {**plain_numpy(), **plain_library()}),
        ):
            equal = sum(map(str.__eq__, usual, digests(setting, policy, flights, **fields)))
            print(f"{policy:10s} {name:32s} {equal}", flush=True)


if __name__ == "__main__":
    main()
