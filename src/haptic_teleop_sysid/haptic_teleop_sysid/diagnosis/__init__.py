"""Diagnosis: locate a mismatch, name the physics that was left out, model it, show the fit improve."""
