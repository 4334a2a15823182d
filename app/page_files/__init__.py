"""The pages' files on their way to a browser."""
