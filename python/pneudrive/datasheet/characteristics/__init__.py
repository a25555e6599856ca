"""Modules of the characteristics."""
