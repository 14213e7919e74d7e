"""Speed and accuracy against bounds and peers; each script prints a table."""
