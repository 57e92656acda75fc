"""For tests of one's own: missions that Hypothesis draws, and fixtures for pytest."""
