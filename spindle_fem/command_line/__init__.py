"""The command line: the application with what all commands share, and families of commands."""
