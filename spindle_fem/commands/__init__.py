"""One function a command: a study, its files and its report."""
