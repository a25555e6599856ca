"""A run of a drive or circuit: start, commands, session, trajectory, warnings."""
