"""Other programs' models of robots, MJCF and URDF, as tables of a problem file; what becomes of each part is said.

``robot`` is the way in. ``reading/`` has MuJoCo read a file, ``tables/`` makes tables of what it compiled, ``writing``
makes text of these, ``fitting/`` finds shapes in place of meshes.
"""
