"""Heat conduction: operators, problems, solvers, steps in time, evaluation."""
