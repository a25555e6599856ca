"""Characteristics of a drive, each with unit, interval, standard and source, and the numbers of a datasheet."""
