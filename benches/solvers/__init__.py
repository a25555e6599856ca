"""One file for each solver: `name`, `case_a(tol)` and `case_c(tol)` give p-T states.

`bare_a` and `bare_c` are the timed functions.
"""
