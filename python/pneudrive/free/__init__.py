"""Free numbers of a drive: their names, derived values, and the drive for any of their values."""
