"""Heat, films and exchange nodes on the named surfaces of a machine."""
