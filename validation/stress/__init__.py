"""Who stays right under stress: the seeded campaign, and the stress table."""
