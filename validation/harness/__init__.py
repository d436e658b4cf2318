"""What all scripts share. A caller takes types and modules from this door."""

from validation.harness.cli import MissingDataError
from validation.harness.processes import LATE, Bench, Job, Work
from validation.harness.tables import Row
