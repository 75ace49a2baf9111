"""Point-robot mazes with LIDAR, after "Curiosity creates Diversity in Policy Search"."""
