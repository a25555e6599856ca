"""Seconds, side by side with other solvers: ``make bench``. Tracked, never gating."""
