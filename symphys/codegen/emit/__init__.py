"""From a program to C sources."""
