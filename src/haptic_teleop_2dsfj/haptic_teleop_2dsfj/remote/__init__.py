"""A board in another computer: its server, and what the driver has in place of the board."""
