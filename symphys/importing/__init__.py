"""Import of robot models, MJCF and URDF, as tables of a problem file, with a finding on each part of the model.

``robot`` is the entry. ``reading/`` has MuJoCo read a file, ``tables/`` makes tables of the compiled model, ``writing``
makes text of these, ``fitting/`` finds shapes in place of meshes.
"""
