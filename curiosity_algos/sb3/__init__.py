"""Wrappers, callbacks and a replay buffer for Stable-Baselines3's own algorithms."""
