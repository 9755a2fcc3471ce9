"""Figures of robots: joints, gaits, poses."""
