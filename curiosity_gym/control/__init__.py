"""Sparse tasks of the DeepMind Control Suite; making one imports the simulator."""
