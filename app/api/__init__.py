"""The HTTP API under /api: a router a noun, each route parses, calls one plain function and returns its value."""
