"""The parametric world: bodies, joints and pairs whose numbers may be replaced by symbols."""
