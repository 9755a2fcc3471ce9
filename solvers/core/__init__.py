"""Parts that all methods share: driver, counting evaluator, checkpoint, continuation, convergence, line search."""
