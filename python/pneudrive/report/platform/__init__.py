"""Drawings of platforms on legs."""
