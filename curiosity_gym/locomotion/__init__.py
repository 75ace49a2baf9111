"""Gymnasium's MuJoCo robots with a behavior; what simulates is imported when one is made."""
