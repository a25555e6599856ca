"""Scores of runs, comparisons of controllers, and their files."""
