"""The pages' files on their way to a browser: packed, under addresses that change when a file does, and named by the document that needs them."""
