"""Drones in words."""


def numbers_text(agents: tuple[int, ...]) -> str:
    """``agents 3, 4 and 7``."""
    if len(agents) == 1:
        return f"agent {agents[0]}"
    return "agents " + ", ".join(str(agent) for agent in agents[:-1]) + f" and {agents[-1]}"


def agents_text(agents: int) -> str:
    """``1 agent``, ``25 agents``."""
    return f"{agents} agent{'' if agents == 1 else 's'}"


def lost_text(agents: tuple[int, ...]) -> str:
    """Which drones were lost, shortened if they are many."""
    return "none" if not agents else numbers_text(agents) if len(agents) <= 12 else f"{len(agents)} agents"
