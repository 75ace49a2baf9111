"""The ground floor: files, checkpoints, randomness, networks. It imports no sibling."""
