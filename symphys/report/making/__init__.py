"""Many pages at once: which are made, full or light, in how many processes; no page's failure keeps others away."""
