"""C sources of programs."""
