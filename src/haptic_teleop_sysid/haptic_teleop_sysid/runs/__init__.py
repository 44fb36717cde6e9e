"""What commands do from the names of recordings, and how it is shown."""
