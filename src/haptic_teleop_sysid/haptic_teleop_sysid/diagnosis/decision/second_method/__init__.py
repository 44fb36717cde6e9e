"""When the names of the inverse dynamics are believed, and what they become as a result."""
