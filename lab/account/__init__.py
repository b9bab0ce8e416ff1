"""The words that the account takes for talk."""
