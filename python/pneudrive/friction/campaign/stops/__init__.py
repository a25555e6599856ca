"""Stops: relaxation while held, breakaway peak, way back, and breakaway over stop duration."""
