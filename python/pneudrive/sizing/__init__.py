"""Sizing: find the drives of the catalogue that do a task, simulate them over given spreads, and rank them."""
