"""The Python interface: load, solve, simulate, compile, read. ``symphys`` itself exports its public names."""
