"""Authoring in conversation: versions of a scene, made from words, kept in a thread."""
