"""Is it good? The claims of README.md, one script each; run as README.md there says.

The list of all that is measured is report.py, the claims are claims/claims.toml.
"""
