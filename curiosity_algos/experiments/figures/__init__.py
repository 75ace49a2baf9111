"""Figures of runs, the paper's among them, as matplotlib's Figure objects."""
