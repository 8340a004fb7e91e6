"""One function per command: a study, its files and its report."""
