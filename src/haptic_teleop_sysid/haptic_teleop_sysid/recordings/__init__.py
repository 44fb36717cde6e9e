"""A recording as a data set of one joint: channels, times, impossible readings, treatment before a fit."""
