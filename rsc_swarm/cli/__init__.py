"""The ``rsc-swarm`` command: one file a command, and the options that they share."""

import sys

from rsc_swarm.foreign import foreign_module

_BAD_USAGE = 2  # protocols.errors, which may be what cannot be imported

if _found := foreign_module():
    print(f"rsc-swarm: {_found}", file=sys.stderr)
    sys.exit(_BAD_USAGE)
