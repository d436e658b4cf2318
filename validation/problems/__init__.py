"""Scenes and generators of problems; nothing here solves or compares.

A caller takes a module from this door: `from validation.problems import data_sets`.
"""
