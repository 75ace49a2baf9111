"""Exploration bonuses, and the motivation made of them."""
