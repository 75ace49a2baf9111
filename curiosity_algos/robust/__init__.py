"""From found episodes to a policy that works from any start."""
