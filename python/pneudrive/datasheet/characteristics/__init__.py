"""One module per characteristic."""
