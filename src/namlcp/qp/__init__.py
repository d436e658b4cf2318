"""Convex QPs: the forms a solve chooses from, and what proves an answer."""
