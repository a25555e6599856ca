"""Commands that hand over results."""
