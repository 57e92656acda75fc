"""The ``rsc-swarm`` command: one file a command, and the options that they share."""
