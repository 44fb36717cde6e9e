"""Simulated time that advances by answers, not by a clock: who acts when, and what has to be there before it
goes on. Pure: messages in, messages out; the nodes' side is `nodes.timing`."""
