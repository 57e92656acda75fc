"""Policies: what a drone wants to do, from what it sees. A new controller is one class with one method."""

from agent.policy.base import Policy, PolicyError, Seen
from agent.policy.registry import files_of, find_policy, policy_names

__all__ = ["Policy", "PolicyError", "Seen", "files_of", "find_policy", "policy_names"]
