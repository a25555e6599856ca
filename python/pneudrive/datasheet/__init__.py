"""What a drive does: characteristics with unit, interval, standard and source, and the numbers of a datasheet."""
