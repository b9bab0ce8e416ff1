"""How people give way, measured on a corpus."""
