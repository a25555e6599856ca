"""Data sheet of a drive."""
