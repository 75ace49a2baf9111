"""Populations of parameters in, rollouts out."""
