"""Reduction of recordings and campaigns: sliding, settling, pairing, budget, peaks, stick-slip."""
