"""The verification and validation book: chapters that are made by running the program.

``python -m book -o reports/book`` builds it, ``make book`` sets everything up first.
"""
