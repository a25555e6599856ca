"""One file a solver: `name`, `case_a(tol)` and `case_c(tol)` give p-T states; `bare_a`, `bare_c` what is timed."""
