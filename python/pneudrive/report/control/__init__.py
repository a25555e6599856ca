"""Report of a controlled axis."""
