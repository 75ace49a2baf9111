"""The loops that algorithms run in, and what only they need."""
