"""What long work shares: progress, files that are whole, seal files."""
