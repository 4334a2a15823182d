"""What lies in the data folder, sealed by a key that the administrator keeps."""
