"""Motivations: an individual's interest beside reward."""
