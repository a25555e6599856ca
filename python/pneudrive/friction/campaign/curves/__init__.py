"""Curves over speed with their bands."""
