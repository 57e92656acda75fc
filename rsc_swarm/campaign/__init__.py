"""Random faults within a budget: what breaks, the shortest mission that still breaks so, kept as a test."""
