"""Gymnasium's MuJoCo robots with a behavior; making one imports the simulator."""
