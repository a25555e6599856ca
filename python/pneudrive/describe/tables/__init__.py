"""Tables of a drive file."""
