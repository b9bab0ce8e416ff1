"""What people and machines run: the command line."""
