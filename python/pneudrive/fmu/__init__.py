"""Export of drives to other tools, as Functional Mock-up Units (FMI 2.0 or 3.0) or as a library for C."""
