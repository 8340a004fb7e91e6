"""What the commands work out, one study a command."""
