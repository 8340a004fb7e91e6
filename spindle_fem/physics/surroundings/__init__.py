"""What surrounds the machine: air, radiation, rotating surfaces, gaps, joints.

Knows no mesh and no machine: numbers in SI in, numbers in SI out.
"""
