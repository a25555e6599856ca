"""Statistics and numerics of arrays and callables, each usable without the rest of the package."""
