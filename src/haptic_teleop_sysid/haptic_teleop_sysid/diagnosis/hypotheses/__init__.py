"""What may be missing: effects at their places; what makes one admissible, material, another's twin."""
