"""Training of the learned reader; needs torch, which reading does not."""
