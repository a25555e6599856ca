"""An independent model of the drive, in plain Python and SciPy, that the core is compared with."""
