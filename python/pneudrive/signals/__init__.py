"""Measured signals: recordings, their layouts, strokes and samples; independent of friction."""
