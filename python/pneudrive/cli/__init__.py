"""Command line. It parses arguments, calls functions and shows results, and computes nothing itself."""
