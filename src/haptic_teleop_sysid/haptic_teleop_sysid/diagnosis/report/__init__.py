"""What is told: the result file, the page, the terminal, the next experiment."""
