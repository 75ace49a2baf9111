"""Evaluators: they play one episode with each policy of a population and record it."""
