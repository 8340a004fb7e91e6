"""Diagnosis: where a recording and a model differ, which physics is missing, and how it improves the fit."""
