"""What a recording of a teleoperation scenario shows: its signals, its phases, and figures of merit from
them.
"""
