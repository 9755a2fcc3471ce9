"""What a world is, as data: bodies, shapes, static surfaces, contact laws, joints, controllers, the state layout."""
