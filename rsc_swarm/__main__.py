"""``python -m rsc_swarm`` is ``rsc-swarm``."""

from rsc_swarm.cli.main import main

main()
