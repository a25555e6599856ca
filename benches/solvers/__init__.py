"""One file a peer: each gives objects with `name`, `case_a(tol)` and, where it can, `case_c(tol)`."""
