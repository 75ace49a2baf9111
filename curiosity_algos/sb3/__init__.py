"""What Stable-Baselines3's own algorithms take."""
