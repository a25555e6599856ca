"""Circuits that follow a recorded motion: volumes, heat, walls and leaks of closed chambers from their pressures."""
