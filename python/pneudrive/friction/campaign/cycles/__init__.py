"""Cycles of a campaign folder: samples, sensors, means."""
