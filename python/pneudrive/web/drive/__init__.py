"""Requests of the page on drives: descriptions, runs, tasks, controllers, exports."""
