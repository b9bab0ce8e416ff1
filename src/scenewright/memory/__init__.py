"""Memory: of a run (state), of a conversation (threads), and of accepted scenes (episodes)."""
