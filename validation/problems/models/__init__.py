"""What people model in CVXPY: statistics (fits) and decisions (plans, portfolios)."""

from validation.problems.models import decisions, statistics

MODELS = statistics.MODELS | decisions.MODELS
