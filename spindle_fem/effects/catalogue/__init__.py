"""One file an effect; a new file is a new effect."""
