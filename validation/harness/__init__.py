"""What all scripts share. A caller takes types and modules from this door.

===========  ===========================================================================
suite        problems, solvers and tolerances as data, and the one way to run them
cli          command lines: the usual options, the header of results, missing data
csv_files    results, with the machine above the rows
machine      what times depend on: processor and versions; which solvers are installed
processes    a solver in a child process with a time limit; what was late
qp_solvers   what each solver is told
judging      is an answer right? residuals recomputed from the point
conic        QPs in conic form, and the solver that takes no other
qps          QPs of qpsolvers taken apart and put together
quiet        is the machine quiet enough for a timing?
tables       rows selected and printed
timing       times and memory of calls
data_folder  the data folder, which is no part of this repository
charts       the style of the figures
===========  ===========================================================================
"""

from validation.harness.csv_files import Row
from validation.harness.data_folder import MissingDataError
from validation.harness.processes import LATE, Bench, Job, Work
