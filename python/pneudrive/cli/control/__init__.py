"""Command that controls a drive."""
