"""What a drive is: quantities with units, checked, from Python or from TOML."""
