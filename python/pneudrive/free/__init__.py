"""Numbers of a drive that may be free: their names, what follows from them, and a drive for each of their values."""
