"""Benchmarks of computing time against other solvers: ``make bench``. Tracked, never gating."""
