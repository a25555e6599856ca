"""Proposal of a layout for a foreign recording."""
