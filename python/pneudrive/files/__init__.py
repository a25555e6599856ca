"""Files from outside: one place that opens them, one table of bounds, one list of what may go wrong.

- `bounds`: how large, deep and long what a user gives may be.
- `content`: bytes and text of a file, JSON, the nesting of JSON and TOML.
- `tables`: columns of Parquet, netCDF, TDMS, MF4 and MAT files; what a library written in C reads is read by
  `reader_process`, so that a damaged file never ends this process.
- `seal`: Parquet files that carry the SHA-256 of their own bytes.
"""
