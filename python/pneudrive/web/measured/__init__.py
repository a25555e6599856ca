"""Requests of the page on measurements: recordings, campaigns, friction maps, validations."""
