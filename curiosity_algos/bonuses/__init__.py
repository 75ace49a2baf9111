"""Exploration bonuses: how new a transition is."""
