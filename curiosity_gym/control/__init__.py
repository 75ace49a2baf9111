"""Sparse tasks of the DeepMind Control Suite; what simulates is imported when one is made."""
