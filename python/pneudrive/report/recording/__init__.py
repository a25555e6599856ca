"""Sections of a report on recordings."""
