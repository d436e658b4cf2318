"""Convex QPs: reduction to the smallest form, the forms, recovery and judgement."""
