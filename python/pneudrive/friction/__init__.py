"""Sliding friction: reduction, results of recordings, results of campaigns."""
