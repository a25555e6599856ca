"""Tests of the documentation: tutorials, examples, notebooks, and its pages in a browser; make docs."""
