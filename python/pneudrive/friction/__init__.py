"""Sliding friction: what it is reduced by, of recordings, of campaigns."""
