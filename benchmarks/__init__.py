"""Measurements beside peers; no part of the installed packages."""
