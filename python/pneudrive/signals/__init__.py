"""What is measured: recordings, the layouts by which they are read, strokes and samples; knows no friction."""
