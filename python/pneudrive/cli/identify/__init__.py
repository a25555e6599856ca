"""Commands that identify, validate and report."""
