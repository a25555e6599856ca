"""Models that follow a recorded input: closed chambers along a motion, and regulators under a command."""
