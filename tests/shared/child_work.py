"""What child processes of a suite do in a test; they import nothing else."""

import os
import time


def answer(job, problem, eps):
    """Be late at the second problem, die at the third: the work of a child."""
    job.ready()
    if job.solver == "slow" and problem == 2:
        time.sleep(60.0)
    if job.solver == "frail" and problem == 3:
        os._exit(1)
    return {"success": True, "status": "solved", "runtime": eps}
