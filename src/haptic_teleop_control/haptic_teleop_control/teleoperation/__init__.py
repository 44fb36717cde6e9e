"""Master and slave coupled: the state machine, the two sides, the channels between them, the energies."""
