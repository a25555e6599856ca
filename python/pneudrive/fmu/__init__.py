"""A drive for other tools: a Functional Mock-up Unit (FMI 2.0 or 3.0), or a library for C."""
