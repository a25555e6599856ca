"""Commands that size and characterise a drive."""
