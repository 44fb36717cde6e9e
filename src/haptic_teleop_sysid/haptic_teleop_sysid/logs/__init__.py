"""Logs as people have them: tables of text, MATLAB, NumPy and Parquet files, bags of any ROS, read by
libraries and turned into recordings by a mapping, by their headers, or not at all."""
