"""Campaigns: run, interrupted, damaged, read."""
