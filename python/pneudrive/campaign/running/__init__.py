"""Cycles of a plan on a rig."""
