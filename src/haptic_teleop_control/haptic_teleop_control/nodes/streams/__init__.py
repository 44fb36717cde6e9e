"""Joint states on topics: checked samples in, preallocated messages out, how long an answer takes."""
