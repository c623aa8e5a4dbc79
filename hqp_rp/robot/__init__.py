"""Robots behind one protocol: MuJoCo and Pinocchio adapters, and arms made from their DH rows."""
