"""``python -m rsc_swarm`` is ``rsc-swarm``."""

from rsc_swarm.cli import main

main()
