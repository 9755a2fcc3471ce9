"""Functions of casadi types that every part of the dynamics uses: rotations, smoothed primitives."""
