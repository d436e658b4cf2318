"""Contact with Coulomb friction as LCPs, see `friction`."""

from namlcp.scenes import friction

__all__ = ["friction"]
