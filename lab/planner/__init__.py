"""The model that ranks what a turn of a conversation may mean."""
