"""Tests of the page in a browser: make test-page."""
