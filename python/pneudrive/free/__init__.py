"""Free parameters of a drive: names, derived values, and the drive as a function of the parameters."""
