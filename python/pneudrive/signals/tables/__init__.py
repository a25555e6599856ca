"""Tables of foreign files: formats, forms of text, units of columns, dates."""
