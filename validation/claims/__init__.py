"""Every figure that the README files claim, from one table, claims.toml."""
