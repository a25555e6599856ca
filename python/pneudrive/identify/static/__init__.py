"""Fits of friction over speed and pressure."""
