"""The ground floor: randomness, networks, presets, clusters. It imports no sibling."""
