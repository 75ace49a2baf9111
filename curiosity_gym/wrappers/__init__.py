"""Wrappers that give other packages' environments what those of this package offer."""
