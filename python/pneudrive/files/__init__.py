"""Reading of files from outside: one place that opens them, one table of bounds, one set of error messages.

`bounds` has the largest size, depth and length of input. `content` reads bytes, texts, JSON and CSV.

`tables` reads columns of Parquet, netCDF, TDMS, MF4 and MAT files. `formats` is the process that calls libraries
written in C. A damaged file can only end that process.

`seal` writes Parquet files that carry the SHA-256 of their bytes.
"""
