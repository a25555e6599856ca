"""Characteristics of a drive with unit, interval, standard and source, and the numbers of a datasheet."""
