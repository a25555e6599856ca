"""Files from outside: one place that opens them, one table of bounds, one set of error messages.

- `bounds`: largest size, depth and length of input.
- `content`: bytes and text of a file, JSON, CSV, the nesting of JSON and TOML, kinds of files.
- `tables`: columns of Parquet, netCDF, TDMS, MF4 and MAT files.
- `formats`: the process that calls libraries written in C, so that a damaged file never ends this process.
- `seal`: Parquet files that carry the SHA-256 of their bytes.
"""
