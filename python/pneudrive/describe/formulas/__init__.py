"""Friction laws and components that a user writes as formulas."""
