"""LCPs that are neither P nor semidefinite: success and time, pictures, time steps."""
