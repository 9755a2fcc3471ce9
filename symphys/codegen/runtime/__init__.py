"""A compiled kernel on the processor: batches, threads, memory."""
