"""A layout proposed for a foreign recording."""
