"""The friction of a campaign: curves, effects, stops and comparison, each with its uncertainty."""
