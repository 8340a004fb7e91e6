"""Concealed-effect studies: machines made by a model that shares nothing with ``spindle_fem``."""
