"""Print all claims."""

from validation.claims import claims, moved

now = claims()
print(moved(now, now))
