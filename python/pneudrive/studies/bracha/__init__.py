"""Reproduction of the source paper's figures from simulated data, and a verdict on each checkable sentence."""
