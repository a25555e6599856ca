"""Stops: relaxation while held, breakaway peak, return to sliding, and breakaway over stop duration."""
