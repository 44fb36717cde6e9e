"""From recordings to data sets, fits, comparisons, verification and reports.

Pure and on the command line: nothing here needs a running node.
"""
