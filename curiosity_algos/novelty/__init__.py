"""Novelty of behaviors: how far they are from what was seen."""
