"""Tests of the documentation in a browser: make docs."""
