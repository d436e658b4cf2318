"""Contact with Coulomb friction as LCPs, see `friction`."""
