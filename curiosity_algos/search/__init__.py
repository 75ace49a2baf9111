"""Search strategies in parameter space."""
