"""What Python calls: load, solve, simulate, compile, read. Everything here is handed on by ``symphys`` itself."""
