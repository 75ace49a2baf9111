"""Experiments: statistics over the runs of algorithms on tasks."""
