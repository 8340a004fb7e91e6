"""Fast models as files that other programs step: state space, C, Python, functional mock-up unit."""
