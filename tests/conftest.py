"""What all tests share: random examples may take their time on a busy machine."""

from hypothesis import settings

settings.register_profile("swarm", deadline=None)
settings.load_profile("swarm")
