"""The assignment problem that all solvers take."""

from assoc.problem.problem import AssignmentProblem, check_problem, taken_problem

__all__ = ["AssignmentProblem", "check_problem", "taken_problem"]
