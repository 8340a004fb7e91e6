"""The lumped network beside the finite elements, node by node and link by link."""
