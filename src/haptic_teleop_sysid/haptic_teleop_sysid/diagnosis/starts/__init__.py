"""From which effects and sizes a fit begins: scan, screen, shortlist, trials."""
