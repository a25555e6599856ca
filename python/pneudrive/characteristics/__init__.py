"""Characteristics of a campaign: friction over speed, pressure, position, stops and time, each with its uncertainty."""
