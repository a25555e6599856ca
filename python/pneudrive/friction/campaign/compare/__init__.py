"""Comparison of two campaigns."""
