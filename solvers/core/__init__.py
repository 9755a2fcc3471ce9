"""What all methods share: the driver, the counting evaluator, the checkpoint, continuation, line search."""
