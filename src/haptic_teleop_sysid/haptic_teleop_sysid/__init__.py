"""From recordings to data sets, fits, comparisons, diagnosis, verification and reports.

Pure and on the command line: nothing here needs a running node.
"""
