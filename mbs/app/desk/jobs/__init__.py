"""Long work in child processes that can be stopped, and the cards that show it."""
