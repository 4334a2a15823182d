"""Work in processes and threads of its own, so that a server never waits for it."""
