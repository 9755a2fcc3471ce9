"""Many pages at once: which are made, in how many processes; no page's failure keeps others away."""
