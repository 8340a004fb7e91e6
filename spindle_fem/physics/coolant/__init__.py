"""Coolant in a helical channel: properties, film coefficient, friction, enthalpy march.

Knows no mesh and no machine: numbers in SI in, numbers in SI out.
"""
