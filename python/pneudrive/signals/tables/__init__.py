"""Tables of foreign files: formats, text, units of columns, dates."""
