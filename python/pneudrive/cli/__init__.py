"""Command line: parse, call, show; no numerics."""
