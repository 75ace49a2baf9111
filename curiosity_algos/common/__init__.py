"""The ground floor: randomness, networks, presets. It imports no sibling."""
