"""Surroundings of the machine: air, radiation, rotating surfaces, gaps, joints.

Independent of mesh and machine: numbers in SI in, numbers in SI out.
"""
