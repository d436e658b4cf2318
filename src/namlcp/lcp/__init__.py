"""Box LCPs: the route of a solve, and the methods that it chooses from."""
