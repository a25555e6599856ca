"""Report of a sizing."""
